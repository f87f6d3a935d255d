"""The table of an identification: shares of what is there, sizes of what is not."""

from types import SimpleNamespace
from typing import Any

import pytest

from experiments.identify.plots import table_rows
from robots.identification.identified_robot import FoundParameter


def row(value: float, sigma: float, true: float | None) -> list[str]:
    parameter = FoundParameter("play_gear_2", "rad", value, sigma, False, true)
    study: Any = SimpleNamespace(parameters=[parameter], plant=object())
    return table_rows(study)[0]


@pytest.mark.parametrize("value", [0.0, 2.0e-19])
def test_a_gear_without_play_is_told_by_how_much_it_may_have_and_was_off(value: float):
    """A share of nothing, 1.6e15 %, says nothing."""
    name, shown, sigma, unit, known, true, error = row(value, 3.2e-6, 0.0)
    assert (sigma, unit, known, true) == ("± 3.2e-06", "rad", "no", "0")
    assert float(error) == pytest.approx(value)
    assert "%" not in "".join((name, shown, sigma, error))


def test_what_is_there_is_told_in_shares():
    assert row(1.1e-4, 1.1e-6, 1.0e-4)[2:] == ["1.00%", "rad", "no", "0.0001", "+10.00%"]
