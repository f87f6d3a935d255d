"""Path correction over the bytes of a wire: the controller runs its own path, the camera moves it across."""

import numpy as np
import pytest

from diagrams.hardware_link import StationError
from diagrams.runs.path_correction import CorrectedPass, PathCorrectionRun
from diagrams.scenario.scenario import load_scenario
from robots.description.model import load_robot
from tests.diagrams.lockstep import Lockstep

ROBOT = load_robot("irb1200")
OWN_PATH = [
    "station.link.run.path_correction=true",
    *("reference.acceleration=6", "reference.settle=0.8", "reference.dwell=0.1"),
]


def run(*settings: str) -> tuple[CorrectedPass, np.ndarray, np.ndarray, Lockstep]:
    """A pass, how far the true tool was beside the path and across the robot's edge in m, and the wire."""
    scenario = load_scenario("cell", [*OWN_PATH, *settings])
    wire, correction = Lockstep(scenario), PathCorrectionRun(scenario, ROBOT)
    found = correction.run(wire.link, wire.camera(), now=wire.now)  # pyright: ignore[reportArgumentType]
    X_WE, _ = wire.cell.record().at(found.stamps)
    known = np.isfinite(X_WE[:, 0, 3])
    tool, places = X_WE[known, :3, 3], found.places[known]
    both = correction.beside(tool), correction.across(tool, places)
    return found, *(np.linalg.norm(each, axis=1) for each in both), wire


@pytest.mark.slow
def test_what_lies_across_the_path_is_corrected():
    """The robot of the cell is off by 20 mm and more; what lies along the path shows only behind a corner."""
    corrected, beside, across, wire = run()
    assert corrected.ended == "path"
    assert beside[0] > 0.02
    assert np.median(beside) < 0.25 * beside[0]
    # What lay along an edge is beside the next one at first; without corrections it is 33.7 mm.
    assert beside[190:].max() < 0.02
    # What can be corrected is off by less, while it turns from the frame before a corner to that behind it.
    assert across[190:].max() < 0.75 * beside[190:].max()
    # At rest at the end of the settling time, behind the lag of filter and controller, it is on the path.
    assert beside[190] < 1e-4
    assert wire.controller.counters()["ignored"] == 0


@pytest.mark.slow
def test_a_controller_that_stops_ends_the_pass_by_name():
    found, _, _, wire = run("station.faults.stop_at=2.0")
    assert "the controller stopped" in found.ended
    assert "before the end of the path" in found.ended
    assert wire.controller.references[0][0] != wire.controller.references[0][0]  # NaN: it stands


@pytest.mark.slow
def test_a_controller_that_waits_to_be_guided_is_not_waited_for_without_end():
    """Its robot stands at the start and takes no correction of a path."""
    found, _, _, _ = run("station.link.run.path_correction=false")
    assert found.ended == "the robot has not moved on for 21 s; does its controller run the path?"


@pytest.mark.slow
def test_a_robot_on_another_path_is_not_corrected():
    """The circle of the scenario lies far from the rectangle that the controller runs."""
    wire = Lockstep(load_scenario("cell", OWN_PATH))
    mine = PathCorrectionRun(load_scenario("cell", [*OWN_PATH, "reference.path=!Circle {}"]), ROBOT)
    with pytest.raises(StationError, match="from the path of the scenario"):
        mine.run(wire.link, wire.camera(), now=wire.now)  # pyright: ignore[reportArgumentType]
