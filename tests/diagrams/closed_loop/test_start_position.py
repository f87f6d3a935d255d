"""Where a run starts: the path is tried before, all of it, and laps that repeat the first one only once."""

import numpy as np
import pytest

from diagrams.runs.simulation import run
from diagrams.runs.start import start_position
from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario, ScenarioError
from robots.description.model import load_robot
from systems.reference.cartesian_path import CartesianPath
from systems.reference.paths import make_path
from tests.diagrams.rigs import scenario

# The tool turns once about its own axis, always the same way: joint 6 is wound up by a turn in every lap.
TURNS = (f"{{translation_mm: [450, 100, 400], zyx_deg: [{turn}, 0, 180]}}" for turn in (0, 120, 240, 360))
TURNING = f"reference.path=!Rectangle {{waypoints: [{', '.join(TURNS)}]}}"


def started(found: Scenario) -> tuple[np.ndarray, int]:
    """The start, and at how many poses the path was tried."""
    path, counted = make_path(found.reference), []
    assert isinstance(path, CartesianPath)
    sample = path.sample
    path.sample = lambda time: counted.append(np.size(time)) or sample(time)  # type: ignore[method-assign]
    return start_position(controller_model(found, load_robot(found.robot)), found, path), sum(counted)


def test_laps_that_repeat_the_first_one_are_tried_once():
    once, poses = started(scenario("misaligned"))
    often, of_many = started(scenario("misaligned", "reference.laps=20"))
    np.testing.assert_array_equal(often, once)
    assert of_many <= poses


def test_laps_that_wind_a_joint_up_are_all_tried():
    """From -400 to 400 degrees joint 6 has room for one turn from where the tool is wanted first."""
    started(scenario("nominal", TURNING))
    with pytest.raises(ScenarioError, match=r"joint 4 would turn by 180 deg at once"):
        started(scenario("nominal", TURNING, "reference.laps=2"))


@pytest.mark.slow
def test_a_joint_that_has_to_turn_once_begins_where_it_can():
    """From where it is nearest to home it would come to its limit halfway."""
    log = run(scenario("nominal", TURNING, "reference.timing=polynomial"), "open_loop")
    turned = np.ptp(log.joint_position, axis=0)
    assert turned[5] == pytest.approx(2.0 * np.pi, rel=0.01)
    assert turned[:5].max() < 0.1
    assert log.guard_counts["no_command"] == 0
