"""Numbers that were converted, as one would have written them: without the rounding of the conversion."""

from collections.abc import Iterable

_SAME = 1e-13  # relative: 2 pi with twelve digits, as URDFs have it, is 360 degrees
_DIGITS = 17  # that tell any two numbers apart


def shortest(value: float, least: float = 0.0) -> float:
    """The number with the fewest digits that is the same but for rounding.

    Args:
        value: a finite number.
        least: what is smaller is zero, in the unit of the value.
    """
    if abs(value) <= least:
        return 0.0
    written = (float(f"{value:.{digits}g}") for digits in range(1, _DIGITS))
    return next((each for each in written if abs(each - value) <= _SAME * abs(value)), float(value))


def all_shortest(values: Iterable[float], least: float = 0.0) -> list[float]:
    """`shortest` of each."""
    return [shortest(float(value), least) for value in values]
