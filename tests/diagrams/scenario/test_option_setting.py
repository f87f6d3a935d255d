"""A change that an option has made is refused by the name of that option, in other processes too."""

import pickle

import pytest

from diagrams.scenario.scenario import ScenarioError, load_scenario
from diagrams.scenario.scenario_file import OptionSetting


@pytest.mark.parametrize("value", [0, "", "a b"])
def test_the_option_is_named_also_after_a_way_to_another_process(value: object):
    setting = OptionSetting("reference.laps", value, "--laps")
    for each in (setting, pickle.loads(pickle.dumps(setting))):
        assert each == f"reference.laps={value!r}" if value == "" else f"reference.laps={value}"
        with pytest.raises(ScenarioError, match=rf"^--laps {value}: reference.laps must"):
            load_scenario("misaligned", [each])


def test_an_option_that_takes_names_is_named_with_the_name():
    setting = OptionSetting("station.faults.loss", 2, "--faults loss=")
    for each in (setting, pickle.loads(pickle.dumps(setting))):
        with pytest.raises(ScenarioError, match=r"^--faults loss=2: station\.faults\.loss must"):
            load_scenario("misaligned", [each])


def test_it_changes_the_scenario_as_set_does():
    settings = ["reference.laps=2", OptionSetting("reference.laps", 2, "--laps")]
    assert all(load_scenario("misaligned", [each]).reference.laps == 2 for each in settings)
