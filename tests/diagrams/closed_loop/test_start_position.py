"""Where a run starts: the path is tried before, all of it, and laps that repeat the first one only once."""

import numpy as np

from diagrams.runs.simulation import start_position
from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario
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
    _, poses = started(scenario("nominal", TURNING))
    _, of_three = started(scenario("nominal", TURNING, "reference.laps=3"))
    assert of_three > 2 * poses
