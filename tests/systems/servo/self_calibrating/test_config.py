"""What the self-calibrating law is told is checked before it is used."""

from dataclasses import fields, is_dataclass
from types import NoneType
from typing import Any, get_args

import pytest

from diagrams.scenario.scenario import ScenarioError, load_scenario
from systems.servo.self_calibrating.config import SelfCalibratingConfig

LAW = "servo.laws.self_calibrating"
MUST_BE_POSITIVE = (
    *("lead_frequency", "estimator.calm", "estimator.position_sigma", "estimator.spread.clock"),
    *("drives.position", "drives.integral", "probe.largest_excursion", "dead_time.window"),
)


def settings(part: Any, place: str = LAW):
    """Places and types of all that the law may be told."""
    for entry in fields(part):
        value, at = getattr(part, entry.name), f"{place}.{entry.name}"
        if is_dataclass(value):
            yield from settings(value, at)
        else:
            yield at, entry.type


def is_number(kind: Any) -> bool:
    return kind in (float, int) or set(get_args(kind)) == {float, NoneType}


@pytest.mark.parametrize("place", [at for at, kind in settings(SelfCalibratingConfig()) if is_number(kind)])
def test_no_number_of_the_law_may_be_negative(place):
    """They are sizes, rates and times."""
    with pytest.raises(ScenarioError, match=rf"{place} must be"):
        load_scenario("everything", [f"{place}=-1"])


@pytest.mark.parametrize("name", MUST_BE_POSITIVE)
def test_what_is_divided_by_may_not_be_zero(name):
    with pytest.raises(ScenarioError, match="must be positive"):
        load_scenario("everything", [f"{LAW}.{name}=0"])


@pytest.mark.parametrize("name", ["drive", "probe.kind"])
def test_names_are_those_that_there_are(name):
    with pytest.raises(ScenarioError, match="must be one of"):
        load_scenario("everything", [f"{LAW}.{name}=foo"])
