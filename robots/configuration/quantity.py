"""What a field of a configuration may be, said where the field is: range, unit, size, names to choose from.

One declaration serves the check, its message and the generated documentation.
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import Field, dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np

_KEY = "truetip"


@dataclass(frozen=True)
class Limits:
    """The range of a number, or of each number of a list."""

    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    is_open: bool = False  # whether ``low`` itself is excluded: positive numbers

    def problem(self, value: float) -> str:
        """Why a number is refused, as what it must be; empty if it is not."""
        above = value > self.low if self.is_open else value >= self.low
        return "" if math.isfinite(value) and above and value <= self.high else f"must be {self}"

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        if math.isfinite(self.high) and math.isfinite(self.low):
            first = f"above {self.low:.10g} and at most" if self.is_open else f"between {self.low:.10g} and"
            return f"{first} {self.high:.10g}{unit}"
        if math.isfinite(self.high):
            return f"at most {self.high:.10g}{unit}"
        if not math.isfinite(self.low):
            return f"finite{unit and f', in{unit}'}"
        if self.low == 0.0:
            return ("positive" if self.is_open else "zero or positive") + (unit and f", in{unit}")
        return f"{'above' if self.is_open else 'at least'} {self.low:.10g}{unit}"


@dataclass(frozen=True)
class Declaration:
    """What is known of a field beside its type."""

    limits: Limits = Limits()
    sizes: tuple[int, ...] = ()  # how many numbers a list may have; empty for any
    choices: Callable[[], Collection[str]] | None = None  # of a text
    is_file: bool = False  # whether a text is a path, or the name of something that is shipped


def quantity(
    default: float | int | None,
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
    is_open: bool = False,
) -> Any:
    """A field that holds a number between two limits, which belong to the range.

    Args:
        default: what it is if nothing is said; None for a number that may be left open.
        low, high: the limits.
        unit: for messages and documentation.
        is_open: whether ``low`` is excluded.
    """
    return field(default=default, metadata={_KEY: Declaration(Limits(low, high, unit, is_open))})


def positive(default: float | int | None, unit: str = "") -> Any:
    """A field that holds a finite number above zero."""
    return quantity(default, 0.0, unit=unit, is_open=True)


def numbers(
    default: Sequence[float],
    sizes: tuple[int, ...] = (),
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
    is_open: bool = False,
) -> Any:
    """A field that holds a list of numbers of one of the sizes; a single number counts as a list of one."""
    declaration = Declaration(Limits(low, high, unit, is_open), sizes)
    return field(default_factory=lambda: list(default), metadata={_KEY: declaration})


def vector(
    default: Sequence[float],
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
    is_open: bool = False,
) -> Any:
    """A field that holds a numpy array of as many numbers as its default has."""
    declaration = Declaration(Limits(low, high, unit, is_open), (len(default),))
    return field(default_factory=lambda: np.array(default, dtype=float), metadata={_KEY: declaration})


def named(
    size: int = 0,
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
    is_open: bool = False,
    default: Callable[[], dict[str, Any]] = dict,
) -> Any:
    """A field that holds a number by each of any names, or as many numbers as ``size`` says."""
    declaration = Declaration(Limits(low, high, unit, is_open), (size,) if size else ())
    return field(default_factory=default, metadata={_KEY: declaration})


def choice(default: str, names: Collection[str] | Callable[[], Collection[str]]) -> Any:
    """A field that holds one of the names; a function is asked for them when they are needed."""
    choices = names if callable(names) else lambda: names
    return field(default=default, metadata={_KEY: Declaration(choices=choices)})


def file_name(default: str = "") -> Any:
    """A field that holds the path of a file, ``FILE.py:CLASS``, or the name of something that is shipped."""
    return field(default=default, metadata={_KEY: Declaration(is_file=True)})


def declaration(entry: Field) -> Declaration:
    """What a field of a dataclass declares."""
    return entry.metadata.get(_KEY, Declaration())


def unit_at(part: Any, path: str) -> str:
    """The unit of a field of a tree of dataclasses by its place, such as ``station.payload``.

    Empty where there is no such field, or no unit is declared.
    """
    name, _, below = path.partition(".")
    entry = next((each for each in fields(part) if each.name == name), None) if is_dataclass(part) else None
    if entry is None:
        return ""
    return unit_at(getattr(part, name), below) if below else declaration(entry).limits.unit


def out_of_range(part: Any, keys: tuple[str | int, ...] = ()) -> tuple[tuple[str | int, ...], str] | None:
    """The first number of a tree of dataclasses that is outside the limits of its field, defaults included.

    Returns:
        Names and list indices that lead to it, and what is wrong; None if all numbers are in their ranges.
    """
    if isinstance(part, (dict, list)):
        inside = part.items() if isinstance(part, dict) else enumerate(part)
        below = ((out_of_range(each, (*keys, key))) for key, each in inside)
        return next(filter(None, below), None)
    if not is_dataclass(part):
        return None
    for entry in fields(part):
        value, limits = getattr(part, entry.name), declaration(entry).limits
        for index, number in _numbers(value):
            problem = limits.problem(number)
            if problem:
                return (*keys, entry.name, *index), f"{problem}, got {number:.10g}"
        found = out_of_range(value, (*keys, entry.name))
        if found:
            return found
    return None


def _numbers(value: Any) -> list[tuple[tuple[str | int, ...], float]]:
    """The numbers of a field, with what leads to them: of itself, of a list, an array or a mapping."""
    if isinstance(value, dict):
        return [((key, *inside), number) for key, each in value.items() for inside, number in _numbers(each)]
    if isinstance(value, np.ndarray):
        return [(tuple(map(int, index)), float(number)) for index, number in np.ndenumerate(value)]
    if isinstance(value, list) and all(isinstance(each, (int, float)) for each in value):
        return [((index,), float(number)) for index, number in enumerate(value)]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return [((), float(value))]
    return []


def dotted(keys: Sequence[str | int]) -> str:
    """A place as messages name it: joints[2].drive_train.ratio."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys).lstrip(".")
