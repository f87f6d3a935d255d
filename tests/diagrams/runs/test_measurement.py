"""A station measures itself: at rest, where the statics say, with as much noise as is left in the mean."""

from dataclasses import replace

import numpy as np
import pytest

from diagrams.runs.measurement import MeasurementProcedure, MeasurementRun
from diagrams.scenario.scenario import Scenario, load_scenario
from robots.description.model import load_robot
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.pose import pose_error
from systems.cell.encoders import Encoders

QUIET = ["station.camera.position_sigma=0", "station.camera.orientation_sigma_deg=0"]
PLACES = np.deg2rad([[0, 20, 10, 0, 40, 0], [60, -20, 0, 90, -60, 30], [-50, 60, -60, -120, 70, 100]])


def statics(scenario: Scenario, q: np.ndarray) -> np.ndarray:
    """Poses of the true robot at rest, by its exact kinematics and its springs."""
    robot = load_robot(scenario.robot)
    true = ErrorKinematics(robot).robot_with_errors(scenario.station.errors.vector(robot))
    stiffness = (1.0 / robot.joint_stiffness).tolist()
    static_deflection = replace(true, calibration=replace(true.calibration, compliance=stiffness))
    return CompliantKinematics(static_deflection, scenario.station.payload).forward(q)


@pytest.mark.slow
def test_without_noise_it_writes_down_the_statics():
    """What is left of an oscillation is below the procedure's stillness, 2 micrometres."""
    scenario = load_scenario("misaligned", QUIET)
    record = MeasurementRun(scenario).measure(PLACES)
    expected = statics(scenario, record.measured.q)
    assert np.abs(pose_error(record.measured.X_WE, expected)).max() < 2e-6
    np.testing.assert_allclose(record.measured.X_WE, record.truth.X_WE, atol=2e-6)
    np.testing.assert_allclose(record.measured.q, PLACES, atol=2e-4)  # the drive yields a little to gravity
    np.testing.assert_array_equal(record.measured.payload, 7.0)


def test_encoders_that_err_put_the_links_elsewhere():
    """The joints are said to be where they should, and stand where the scales of their encoders lead them."""
    errors = [
        "station.encoder.scale_ppm=[500,-300,400,-200,600,300]",
        "station.encoder.coupling_ppm=[800,0,0]",
    ]
    scenario = load_scenario("misaligned", [*QUIET, *errors, "station.encoder.eccentricity_deg=0.02"])
    record = MeasurementRun(scenario).measure(PLACES[:1])
    np.testing.assert_allclose(record.measured.q, PLACES[:1], atol=2e-4)
    encoders = Encoders(load_robot(scenario.robot), scenario.station.encoder)
    expected = statics(scenario, encoders.true_position(record.measured.q))
    assert np.abs(pose_error(record.measured.X_WE, expected)).max() < 2e-6
    assert np.abs(pose_error(record.measured.X_WE, statics(scenario, record.measured.q))).max() > 5e-5


@pytest.mark.slow
@pytest.mark.parametrize("period", [0.11, 0.7, 1.0])
def test_a_slow_camera_shows_the_robot_at_rest_and_not_on_its_way(period: float):
    """An exposure from the motion is off by up to 279 mm.

    What is left is an oscillation that the first of a few exposures sees and that dies away before the
    second: 13 um and 70 urad, a third of it in the mean, or a little more.
    """
    scenario = load_scenario("misaligned", [*QUIET, f"station.camera.period={period}"])
    record = MeasurementRun(scenario).measure(PLACES)
    assert record.measured.rows.tolist() == [1, 2, 3]
    assert np.abs(record.measured.position - record.truth.position).max() < 5e-6
    assert np.abs(pose_error(record.measured.X_WE, record.truth.X_WE)).max() < 5e-5


@pytest.mark.slow
def test_a_place_that_a_slow_camera_sees_only_once_is_left_out():
    blind_after = "station.camera.dropouts=[[0.8, 30.0]]"  # exposures at 0.7 s and then from 30.1 s on
    scenario = load_scenario("misaligned", [*QUIET, "station.camera.period=0.7", blind_after])
    with pytest.raises(ValueError, match="the camera saw the tool at none of 2 configurations"):
        MeasurementRun(scenario).measure(PLACES[:2])


@pytest.mark.slow
def test_the_mean_of_a_window_has_the_noise_of_a_mean():
    """50 samples of 50 um leave 7 um; over 3 places and axes the spread is known to a quarter."""
    scenario = load_scenario("misaligned")
    record = MeasurementRun(scenario).measure(np.repeat(PLACES, 4, axis=0), seed=1)
    noise = record.measured.position - record.truth.position
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(50e-6 / np.sqrt(50), rel=0.4)


@pytest.mark.slow
def test_it_can_be_done_again_with_the_same_result_and_another_seed_differs():
    run = MeasurementRun(load_scenario("misaligned"))
    once, again, other = (run.measure(PLACES[:2], seed).measured.position for seed in (3, 3, 4))
    np.testing.assert_array_equal(once, again)
    assert not np.array_equal(once, other)


@pytest.mark.slow
def test_what_the_camera_does_not_see_is_left_out_and_nothing_at_all_is_said():
    procedure = MeasurementProcedure(settle=0.1)
    first = MeasurementRun(load_scenario("misaligned", ["station.camera.dropouts=[[0.0, 0.8]]"]), procedure)
    assert first.measure(PLACES).measured.rows.tolist() == [2, 3]
    blind = MeasurementRun(load_scenario("misaligned", ["station.camera.dropouts=[[0.0, 100.0]]"]), procedure)
    with pytest.raises(ValueError, match="the camera saw the tool at none of 3 configurations"):
        blind.measure(PLACES)
