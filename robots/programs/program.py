"""What a robot program says of the places it moves to, whatever its language.

A program is its text, one character a byte, and the numbers in it that are places. Only these are ever
replaced, so everything else of a program stays as it is, byte for byte.
"""

import re
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from robots.pose import rotation_from_zyx, zyx_from_rotation

MILLIMETRE, DEGREE = 1e-3, float(np.pi / 180.0)
_DECIMALS = {1.0: 13, MILLIMETRE: 9, DEGREE: 11}  # all worth less than 1e-9 mm at the tip of a robot
POSITION, _QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
_UNIT = 0.01  # of the length of a quaternion, which two decimals leave
_EULER = ("alpha", "beta", "gamma")
JOINTS = tuple(f"q{number}" for number in range(1, 7))
_SAME_PLACE = 1e-11  # m; of rounding in the kinematics
_SAME_ANGLE = 1e-10  # rad


class ProgramError(ValueError):
    """A program cannot be read or corrected; the message names file and line."""


@dataclass(frozen=True)
class Literal:
    """A number as it stands in a program."""

    start: int  # characters of the text that it takes
    end: int
    value: float  # as written
    unit: float = 1.0  # SI per unit
    has_comma: bool = False  # 1,5 for 1.5

    @property
    def si(self) -> float:
        """The number in SI units."""
        return self.value * self.unit

    def spelled(self, si: float) -> str:
        """Another number, in SI units, written in place of this one."""
        text = f"{si / self.unit:.{_DECIMALS[self.unit]}f}".rstrip("0").rstrip(".")
        text = "0" if text == "-0" else text
        return text.replace(".", ",") if self.has_comma else text


@dataclass(frozen=True)
class Frame:
    """A tool in the frame of the flange, or a base in the world."""

    name: str
    X: np.ndarray  # (4, 4) m


WORLD = Frame("world", np.eye(4))


def quaternion_problem(numbers: Mapping[str, Literal]) -> str:
    """Why a quaternion among literals by their roles is no rotation but for rounding; empty if it is one."""
    if "qw" not in numbers:
        return ""
    length = float(np.linalg.norm([numbers[role].value for role in _QUATERNION]))
    if not length > 0.0:
        return "the quaternion is zero"
    return "" if abs(length - 1.0) <= _UNIT else f"the quaternion has the length {length:.4g}, not 1"


def declared_pose(position: Sequence[Literal], quaternion: Sequence[Literal], what: str) -> np.ndarray:
    """The pose (4, 4) of a tool or a work object, given in mm and as a quaternion.

    Raises:
        ProgramError: if the quaternion is no rotation; it begins with ``what`` and where it stands.
    """
    if problem := quaternion_problem(dict(zip(_QUATERNION, quaternion, strict=True))):
        raise ProgramError(f"{what}: {problem}")
    R = Rotation.from_quat([each.value for each in quaternion], scalar_first=True).as_matrix()
    return homogeneous([MILLIMETRE * each.value for each in position], R)


@dataclass(frozen=True)
class Note:
    """Something in a program that a person should know of."""

    line: int
    text: str


@dataclass(frozen=True)
class Target:
    """A place that a program moves to: a pose, or positions of the joints.

    ``numbers`` are its literals by role: ``x``, ``y``, ``z`` with ``qw`` to ``qz`` or with the ZYX Euler
    angles ``alpha``, ``beta``, ``gamma``, or ``q1`` to ``q6``; and what the maker writes of the
    configuration: ``cf1``, ``cf4``, ``cf6``, ``cfx`` (ABB), ``status`` and ``turn`` (KUKA).
    """

    name: str
    line: int
    numbers: Mapping[str, Literal]
    tool: Frame | None = None  # None for the tool of the robot file
    base: Frame = WORLD
    payloads: tuple[float, ...] = ()  # kg, with which it is moved to; empty where the program does not say
    load_unread: str = ""  # why the payloads may be others when the program runs

    @property
    def has_joints(self) -> bool:
        """Whether it is positions of the joints."""
        return "q1" in self.numbers

    @property
    def q(self) -> np.ndarray:
        """Joint positions in rad, (6,)."""
        return np.array([self.numbers[role].si for role in JOINTS])

    @property
    def X_BT(self) -> np.ndarray:
        """Pose of the tool in the base, (4, 4)."""
        X = np.eye(4)
        X[:3, 3] = [self.numbers[role].si for role in POSITION]
        if "qw" in self.numbers:
            quaternion = [self.numbers[role].value for role in _QUATERNION]
            X[:3, :3] = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
        else:
            X[:3, :3] = rotation_from_zyx(np.array([self.numbers[role].si for role in _EULER]))
        return X

    def in_single_precision(self) -> "Target":
        """The same target with 24 bits of each number, as controllers of robots keep them."""
        kept = {
            role: replace(each, value=float(np.float32(each.value))) for role, each in self.numbers.items()
        }
        return replace(self, numbers=kept)

    def moved(self, X: np.ndarray) -> dict[Literal, str]:
        """How its numbers are to be written for another pose (4, 4) in the same base."""
        edits = {}
        for role, value in zip(POSITION, X[:3, 3].tolist(), strict=True):
            if abs(value - self.numbers[role].si) > _SAME_PLACE:
                edits[self.numbers[role]] = self.numbers[role].spelled(value)
        turn = Rotation.from_matrix(X[:3, :3] @ self.X_BT[:3, :3].T)
        if turn.magnitude() > _SAME_ANGLE:
            roles = _QUATERNION if "qw" in self.numbers else _EULER
            literals = [self.numbers[role] for role in roles]
            new = self._orientation(X[:3, :3], literals)
            edits |= {each: each.spelled(value) for each, value in zip(literals, new, strict=True)}
        return edits

    def driven(self, q: np.ndarray) -> dict[Literal, str]:
        """How its numbers are to be written for other joint positions (6,) in rad."""
        pairs = zip((self.numbers[role] for role in JOINTS), q.tolist(), strict=True)
        return {each: each.spelled(value) for each, value in pairs if abs(value - each.si) > _SAME_ANGLE}

    def _orientation(self, R: np.ndarray, literals: Sequence[Literal]) -> list[float]:
        """The rotation (3, 3) in the numbers nearest to those that are there."""
        old = np.array([each.si for each in literals])
        if len(literals) == 4:
            quaternion = Rotation.from_matrix(R).as_quat(scalar_first=True)
            return (quaternion * (1.0 if quaternion @ old >= 0.0 else -1.0)).tolist()
        a, b, c = zyx_from_rotation(R)
        both = [np.array([a, b, c]), np.array([a + np.pi, np.pi - b, c + np.pi])]
        near = [old + np.remainder(each - old + np.pi, 2.0 * np.pi) - np.pi for each in both]
        return min(near, key=lambda each: float(np.abs(each - old).sum())).tolist()


@dataclass(frozen=True)
class Move:
    """One motion of a program, to a target or to what cannot be read."""

    line: int
    target: Target | None
    is_straight: bool = False  # whether the tool goes along a line, or the joints in proportion
    why_not: str = ""  # it cannot be followed; empty where it can


@dataclass(frozen=True)
class Program:
    """A program and the places in it that can be corrected, in the order of the text."""

    name: str  # of the file
    text: str  # one character a byte
    targets: tuple[Target, ...]
    notes: tuple[Note, ...]  # what is left alone, and why
    moves: tuple[Move, ...] = ()  # in the order in which they are made; of a table its rows


@dataclass(frozen=True)
class ProgramContext:
    """What is known of a program beyond its own text."""

    others: tuple["Source", ...] = ()  # that declare tools, frames and moves, and are not changed
    tool: str = ""  # of targets for which nothing says one
    base: str = ""  # likewise


@dataclass(frozen=True)
class Source:
    """The text of a file, one character a byte."""

    name: str
    text: str
    _starts: list[int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Finds where lines begin."""
        starts = [0, *(match.end() for match in re.finditer(r"\r\n|\r|\n", self.text))]
        object.__setattr__(self, "_starts", starts)

    def line(self, position: int) -> int:
        """The number of the line of a character, from one."""
        return bisect_right(self._starts, position)

    def where(self, line: int) -> str:
        """File and line."""
        return f"{self.name}, line {line}"


def read_source(path: str | Path) -> Source:
    """Reads a file as bytes. Raises ProgramError if it cannot be read."""
    try:
        return Source(str(path), Path(path).read_bytes().decode("latin-1"))
    except OSError as error:
        raise ProgramError(f"{path}: {(error.strerror or str(error)).lower()}") from error


def edited(text: str, edits: Iterable[tuple[Literal, str]]) -> str:
    """The text with some of its numbers written anew; nothing else changes."""
    parts, at = [], 0
    for literal, new in sorted(edits, key=lambda edit: edit[0].start):
        parts += [text[at : literal.start], new]
        at = literal.end
    return "".join([*parts, text[at:]])


def homogeneous(position: Sequence[float], R: np.ndarray) -> np.ndarray:
    """A frame (4, 4) from its origin in m and its rotation (3, 3)."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, position
    return X
