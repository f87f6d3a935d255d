"""Numbers that an option may not have are refused in its name."""

import math

import pytest

from experiments.cli.option_limits import at_least, at_most, positive


def test_the_least_is_allowed_and_one_less_refused():
    for allowed in (1, None):  # None: the option was not given
        at_least("--jobs", 1, allowed)
    with pytest.raises(ValueError, match=r"^--jobs must be at least 1, got 0$"):
        at_least("--jobs", 1, 0)


@pytest.mark.parametrize("number", [0.0, -2.5, math.inf, math.nan])
def test_only_positive_and_finite_numbers_are_positive(number: float):
    for allowed in (1e-300, None):
        positive("--pace", allowed)
    with pytest.raises(ValueError, match=rf"^--pace must be positive, got {number:g}$"):
        positive("--pace", number)


@pytest.mark.parametrize("number", [-0.5, 30.5, math.inf, math.nan])
def test_what_is_more_than_the_most_or_negative_is_refused_with_its_unit(number: float):
    for allowed in (0.0, 30.0, None):
        at_most("--mass", 30.0, "kg", allowed)
    with pytest.raises(ValueError, match=rf"^--mass must be between 0 and 30 kg, got {number:g} kg$"):
        at_most("--mass", 30.0, "kg", number)
