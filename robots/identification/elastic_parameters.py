"""The unknowns of an elastic arm by name: springs, dampers, play and hysteresis of gears, ripple of ratios.

Springs, times and widths are given by their logarithm, so that they stay positive and a step of 0.1 is a
tenth of any of them. Dampers are springs times a retardation time, one time for a gear, and one for a group
of bearings or beams: motion shows little more. Play, hysteresis and ripple count in units of which one is
much.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS
from robots.description.variation import Factors
from robots.identification.arm_along_motion import ElasticArm

_ARM = 3  # axes of the arm; those behind them are of the wrist
# Of dampers: those of a group have the same retardation time. Gears yield most, so that each has its own: a
# hundredth of theirs would be a tenth of the others'.
GROUPS = (*(f"gear_{joint + 1}" for joint in range(NUM_JOINTS)), "bearings_1_3", "bearings_4_6", "beams")
DIRECTIONS = {"gear": ("",), "bearing": ("a", "b"), "beam": ("x", "y", "z")}  # in which a part yields
PLAY, RIPPLE = 1e-4, 1e-5  # rad, units
RIPPLES_PER_TURN = 2.0  # of the motor, of the ripple that harmonic drives and cycloids have first of all

# What is known before of kinds of unknowns: mean and standard deviation; None for the robot's own value.
_PRIORS: dict[str, tuple[float | None, float]] = {
    "stiffness": (None, 1.0),
    "time": (None, 1.0),
    "play": (0.5, 1.0),
    "lubricant": (float(np.log(0.3)), 0.7),
    "hysteresis": (0.05, 0.1),
    "width": (float(np.log(5e-4)), 0.7),
    "ripple": (0.0, 3.0),
}
_LIMITS = {"play": (0.0, 10.0), "hysteresis": (0.0, 1.0), "ripple": (-30.0, 30.0)}
_FAR = 3.0  # of a logarithm from its start


@dataclass(frozen=True)
class Spring:
    """One stiffness of the robot file and the sprung joints that it belongs to."""

    part: str  # a key of `DIRECTIONS`
    joint: int  # whose part it is, from zero
    direction: int  # in which it yields, an index of its directions
    rows: tuple[int, ...]  # of the sprung joints

    @property
    def name(self) -> str:
        """For example stiffness_gear_1, stiffness_bearing_2_a, stiffness_beam_2_y."""
        return "_".join(
            filter(None, ("stiffness", self.part, str(self.joint + 1), DIRECTIONS[self.part][self.direction]))
        )

    @property
    def group(self) -> int:
        """Of `GROUPS`."""
        if self.part == "beam":
            return GROUPS.index("beams")
        if self.part == "gear":
            return GROUPS.index(f"gear_{self.joint + 1}")
        return GROUPS.index(f"bearings_{'1_3' if self.joint < _ARM else '4_6'}")


@dataclass(frozen=True)
class ArmNumbers:
    """The parameters of e sprung joints, of which the first six are gears."""

    stiffness: np.ndarray  # (e,) N m / rad
    time: np.ndarray  # (e,) s, damper over spring
    play: np.ndarray  # (6,) rad, whole
    lubricant: float  # share of a gear's damper that acts within its play
    hysteresis: np.ndarray  # (6,) share of a gear's spring
    width: float  # rad, over which it slips
    ripple: np.ndarray  # (2, 6) rad, sine and cosine


class ElasticParameters:
    """All unknowns of one robot as a vector, with names, starts, priors and bounds.

    Attributes:
        names: of the unknowns, n.
        kinds: of each, a key of the priors: stiffness, time, play, lubricant, hysteresis, width, ripple.
        springs: in their order.
    """

    def __init__(self, arm: ElasticArm, gear_parts: bool = True, turning: Sequence[int] = ()) -> None:
        """Takes springs and dampers of a robot as the start.

        Args:
            arm: the robot as it is believed to be.
            gear_parts: whether gears may have play, hysteresis and ripple.
            turning: the joints, from zero, whose gears turn far enough to show their ripple.
        """
        self.turning = tuple(turning) if gear_parts else ()
        self.springs = _springs(arm.names)
        self.nominal = arm.parts.sprung_stiffness  # N m / rad, of the sprung joints
        damping = np.array([joint.default_damping() for joint in arm.parts.sprung])
        time = damping / self.nominal
        self.belongs = np.zeros((len(arm.names), len(self.springs)))  # sprung joints to springs
        self.grouped = np.zeros((len(arm.names), len(GROUPS)))  # sprung joints to groups
        for column, spring in enumerate(self.springs):
            self.belongs[list(spring.rows), column] = 1.0
            self.grouped[list(spring.rows), spring.group] = 1.0
        present = [k for k in range(len(GROUPS)) if self.grouped[:, k].any()]
        self.grouped = self.grouped[:, present]
        means = (self.grouped.T @ time) / self.grouped.sum(0)
        self.names = [spring.name for spring in self.springs] + [f"time_{GROUPS[k]}" for k in present]
        self.kinds = ["stiffness"] * len(self.springs) + ["time"] * len(present)
        start = [0.0] * len(self.springs) + np.log(means).tolist()
        for kind, numbers in _gear_unknowns(self.turning) if gear_parts else ():
            self.names += [kind if not n else f"{kind}_{n}" for n in numbers]
            self.kinds += [kind] * len(numbers)
            start += [0.0] * len(numbers)
        mean = [_PRIORS[kind][0] for kind in self.kinds]
        self.start = np.array([s if m is None else m for s, m in zip(start, mean, strict=True)])
        self.prior_sigma = np.array([_PRIORS[kind][1] for kind in self.kinds])
        limits = [
            _LIMITS.get(kind, (s - _FAR, s + _FAR)) for kind, s in zip(self.kinds, self.start, strict=True)
        ]
        self.lower, self.upper = np.array(limits).T

    def __len__(self) -> int:
        """How many there are."""
        return len(self.names)

    def factors(self, p: np.ndarray) -> Factors:
        """How many times the springs of a robot are those that a vector of unknowns, shape (n,), means."""
        found = {part: np.ones((NUM_JOINTS, len(each))) for part, each in DIRECTIONS.items()}
        for spring, factor in zip(self.springs, np.exp(p[self.of_kind("stiffness")]), strict=True):
            found[spring.part][spring.joint, spring.direction] = factor
        return Factors(found["gear"][:, 0], found["bearing"], found["beam"])

    def of_kind(self, kind: str) -> np.ndarray:
        """Indices at which the unknowns of a kind stand, shape (k,)."""
        return np.array([i for i, each in enumerate(self.kinds) if each == kind], dtype=int)

    def numbers(self, p: np.ndarray) -> ArmNumbers:
        """What a vector of unknowns, shape (n,), means."""
        parts = {kind: p[self.of_kind(kind)] for kind in _PRIORS}
        none = np.zeros(NUM_JOINTS)
        has_parts = len(parts["play"]) > 0
        return ArmNumbers(
            self.nominal * np.exp(self.belongs @ parts["stiffness"]),
            np.exp(self.grouped @ parts["time"]),
            PLAY * parts["play"] if has_parts else none,
            float(np.exp(parts["lubricant"][0])) if has_parts else 0.0,
            parts["hysteresis"] if has_parts else none,
            float(np.exp(parts["width"][0])) if has_parts else 1.0,
            self._ripple(parts["ripple"]),
        )

    def _ripple(self, sizes: np.ndarray) -> np.ndarray:
        found = np.zeros((2, NUM_JOINTS))
        found[:, list(self.turning)] = RIPPLE * sizes.reshape(2, -1)
        return found


def _gear_unknowns(turning: Sequence[int]) -> Sequence[tuple[str, Sequence[int | str]]]:
    joints = list(range(1, NUM_JOINTS + 1))
    return (
        ("play", joints),
        ("lubricant", [0]),
        ("hysteresis", joints),
        ("width", [0]),
        ("ripple", [f"{part}_{joint + 1}" for part in ("sine", "cosine") for joint in turning]),
    )


def _springs(names: Sequence[str]) -> list[Spring]:
    """From names of sprung joints: deflection_1, tilt_a_1, beam_2_y1."""
    rows: dict[tuple[str, int, int], list[int]] = {}
    for row, name in enumerate(names):
        kind, *rest = name.split("_")
        if kind == "deflection":
            part, joint, direction = "gear", rest[0], ""
        elif kind == "tilt":
            part, joint, direction = "bearing", rest[1], rest[0]
        else:
            part, joint, direction = "beam", rest[0], rest[1].rstrip("12")
        key = part, int(joint) - 1, DIRECTIONS[part].index(direction)
        rows.setdefault(key, []).append(row)
    return [Spring(*key, tuple(of_spring)) for key, of_spring in rows.items()]
