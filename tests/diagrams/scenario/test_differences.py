"""What a scenario changes against the default one, in a table."""

from diagrams.scenario.differences import scenario_differences
from diagrams.scenario.scenario import Scenario, load_scenario, scenario_text


def test_the_default_scenario_changes_nothing():
    assert scenario_differences(scenario_text(Scenario())) == []


def test_a_changed_field_stands_there_with_both_values_and_no_other():
    text = scenario_text(load_scenario("misaligned", ["station.payload=3"]))
    more = scenario_text(load_scenario("misaligned", ["station.payload=3", "reference.laps=2"]))
    new = set(scenario_differences(more)) - set(scenario_differences(text))
    assert new == {("reference.laps", "2", "1")}
    assert ("station.payload", "3", "0") in scenario_differences(text)


def test_events_with_a_tag_are_named():
    text = scenario_text(load_scenario("misaligned", ["station.events=[!PayloadChange {at: 1.5}]"]))
    rows = {place: here for place, here, _ in scenario_differences(text)}
    assert rows["station.events.1.kind"] == "PayloadChange"
    assert rows["station.events.1.at"] == "1.5"
