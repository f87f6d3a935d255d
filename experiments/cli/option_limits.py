"""Checks of options: ranges of numbers, choices of names; errors name the option."""

import math
from collections.abc import Iterable

import typer

from robots.configuration.suggestion import did_you_mean

_LEAST_LENGTH = 10.0  # mm


def one_of(option: str, names: Iterable[str], given: str | None) -> None:
    """Refuses a name that there is not, with the one that was probably meant; None was not given.

    Raises:
        ValueError: if it is not among the names.
    """
    names = list(names)
    if given is not None and given not in names:
        guess = did_you_mean(given, names)
        raise ValueError(f"{option} must be one of {', '.join(names)}, got '{given}'{guess}")


def at_least(option: str, least: int, given: int | None) -> None:
    """Refuses a number that is too small; None, where the option was not given, is never too small.

    Raises:
        ValueError: if it is less than the least.
    """
    if given is not None and given < least:
        raise ValueError(f"{option} must be at least {least}, got {given}")


def at_most(option: str, most: float, unit: str, given: float | None) -> None:
    """Refuses a number that is negative, not finite or beyond the most; None is an option that was not given.

    Raises:
        ValueError: if it is; with the unit, in which it may not have been meant.
    """
    if given is not None and not 0.0 <= given <= most:
        raise ValueError(f"{option} must be between 0 and {most:g} {unit}, got {given:g} {unit}")


def not_negative(option: str, given: float) -> None:
    """Refuses a number that is negative or not finite.

    Raises:
        ValueError: if it is negative, infinite or NaN.
    """
    if not 0.0 <= given < math.inf:
        raise ValueError(f"{option} must be zero or positive, got {given:g}")


def without_effect(option: str, given: object, beside: str) -> None:
    """Refuses an option that is of no use beside another one; None was not given.

    Raises:
        ValueError: if it was given.
    """
    if given is not None:
        raise ValueError(f"{option} has no effect with {beside}")


def refuse_given(context: typer.Context, names: Iterable[str], where: str) -> None:
    """Refuses options with defaults of their own where they are of no use.

    Args:
        context: of the command that runs.
        names: of its parameters, such as ``spring_error``.
        where: that is, such as ``"with --body"``.

    Raises:
        ValueError: if one of them was given, whatever its value.
    """
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if parameter.name in names and source is not None and source.name == "COMMANDLINE":
            raise ValueError(f"{parameter.opts[0]} has no effect {where}")


def positive(option: str, given: float | None) -> None:
    """Refuses a number that is not positive and finite; None is an option that was not given.

    Raises:
        ValueError: if it is zero, negative, infinite or NaN.
    """
    if given is not None and not 0.0 < given < math.inf:
        raise ValueError(f"{option} must be positive, got {given:g}")


def in_millimetres(option: str, given: float) -> None:
    """Refuses a length of something large that is less than 10 mm, as one in metres is.

    Raises:
        ValueError: if it is, or is infinite or NaN.
    """
    if not _LEAST_LENGTH <= given < math.inf:
        raise ValueError(f"{option} must be at least {_LEAST_LENGTH:g} mm, got {given:g}")
