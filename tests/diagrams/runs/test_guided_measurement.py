"""The measurement run over the bytes of a wire: as good as the simulated one, and no row is lost."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest

from diagrams.hardware_link import EndedOnRequest
from diagrams.runs.guided_measurement import GuidedMeasurement, Row, Visit
from diagrams.runs.measurement import MeasurementRun
from diagrams.scenario.scenario import Scenario, load_scenario
from robots.calibration.measurements import Measurements
from robots.description.model import load_robot
from robots.pose import pose_error
from tests.diagrams.lockstep import Lockstep

ROBOT = load_robot("irb1200")
PLACES = np.deg2rad([[0, 20, 10, 0, 40, 0], [15, 10, 0, 20, 30, 10]])
QUIET = ["station.camera.position_sigma=0", "station.camera.orientation_sigma_deg=0"]
FAULTS = [f"station.faults.{name}" for name in ("loss=0.05", "duplication=0.02", "jitter=0.003")]


def recorded(
    scenario: Scenario, q: np.ndarray, is_asked_to_end: Callable[[int], bool] = lambda rows: False
) -> tuple[Measurements, list[int]]:
    """The table of a run in lockstep, and the numbers of the places that were not seen."""
    wire, rows = Lockstep(scenario), []
    unseen: list[int] = []

    def keep(visit: Visit, row: Row) -> None:
        rows.append((visit.number, *row))

    visits = [Visit(number, place) for number, place in enumerate(q, 1)]
    run = GuidedMeasurement(scenario, ROBOT, speed_share=1.0)
    with suppress(EndedOnRequest):
        unseen = run.run(
            wire.link,
            wire.camera(),  # pyright: ignore[reportArgumentType]
            visits,
            keep,
            now=wire.now,
            is_asked_to_end=lambda: is_asked_to_end(len(rows)),
        )
    numbers, joints, positions, rotations = (np.array(part) for part in zip(*rows, strict=True))
    payload = np.full(len(rows), scenario.station.payload)
    return Measurements(joints, positions, rotations, payload, numbers), unseen


def simulated(scenario: Scenario, q: np.ndarray) -> Measurements:
    return MeasurementRun(scenario).measure(q).measured


@pytest.mark.slow
def test_over_a_bad_wire_it_writes_down_what_the_simulated_run_does():
    """Without noise of the camera the two differ by how still the robot is after half a second."""
    scenario = load_scenario("cell", [*QUIET, *FAULTS])
    found, unseen = recorded(scenario, PLACES)
    expected = simulated(scenario, PLACES)
    assert not unseen
    assert np.abs(pose_error(found.X_WE, expected.X_WE)).max() < 2e-5
    np.testing.assert_allclose(found.q, expected.q, atol=2e-4)


@pytest.mark.slow
def test_an_end_keeps_what_was_measured():
    found, _ = recorded(load_scenario("cell", QUIET), PLACES, is_asked_to_end=lambda rows: rows == 1)
    assert found.rows.tolist() == [1]


@pytest.mark.slow
def test_a_slow_camera_gives_no_exposure_from_motion():
    """At 0.7 s between two exposures a row needs three from rest; one from the way would be off by 100 mm."""
    scenario = load_scenario("cell", [*QUIET, "station.camera.period=0.7056"])
    found, unseen = recorded(scenario, PLACES)
    assert not unseen
    expected = simulated(load_scenario("cell", QUIET), PLACES)
    assert np.abs(pose_error(found.X_WE, expected.X_WE)).max() < 5e-5
