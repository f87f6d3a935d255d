"""Range checks of numeric options; errors name the option."""

import math


def at_least(option: str, least: int, given: int | None) -> None:
    """Refuses a number that is too small; None, where the option was not given, is never too small.

    Raises:
        ValueError: if it is less than the least.
    """
    if given is not None and given < least:
        raise ValueError(f"{option} must be at least {least}, got {given}")


def positive(option: str, given: float | None) -> None:
    """Refuses a number that is not positive and finite; None is an option that was not given.

    Raises:
        ValueError: if it is zero, negative, infinite or NaN.
    """
    if given is not None and not 0.0 < given < math.inf:
        raise ValueError(f"{option} must be positive, got {given:g}")
