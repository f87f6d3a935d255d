"""A camera that fails: short gaps are bridged, long ones stop the robot, false detections are refused."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from diagrams.runs.simulation import Experiment
from systems.samples import PoseSample
from tests.diagrams.rigs import LAWS, QUIET, SETTLE, PlayedStation, scenario, true_errors
from tests.systems.rigs import PERIOD, pose

RIGID = "station.elasticity=rigid"


def counted(experiment: Experiment) -> dict[str, int]:
    return {kind: count for kind, count in experiment.log().guard_counts.items() if count}


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_a_gap_of_40_ms_is_never_noticed_and_the_correction_goes_on(law: str):
    """It costs the correction of 40 ms, which is made up for afterwards."""
    errors = []
    for gaps in ("[]", "[[0.1, 0.14]]"):
        settings = [*QUIET, *SETTLE, RIGID, f"station.camera.dropouts={gaps}"]
        experiment = Experiment(scenario("misaligned", *settings), law)
        experiment.advance(2.5)
        assert counted(experiment) == {}
        errors.append(true_errors(experiment)[1][:, 3:])
    whole, gap = (np.linalg.norm(part, axis=1) for part in errors)
    lost = np.linalg.norm(errors[1] - errors[0], axis=1)
    assert lost.max() > 0.5e-3
    assert lost[-1] < 0.05 * lost.max()
    assert whole[-1] < 0.01 * whole[0]
    assert gap[-1] < 0.01 * gap[0]


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_a_gap_of_a_second_is_held_after_50_ms_and_stopped_for_good_after_500_ms(law: str):
    """On the moving path: the robot goes on along it without correction, then it comes to rest."""
    settings = ["reference.settle=0", "reference.acceleration=2", "station.camera.dropouts=[[0.3, 1.3]]"]
    experiment = Experiment(scenario("misaligned", *QUIET, *settings, RIGID), law)
    experiment.advance(1.6)
    log = experiment.log()
    started = {event.kind: event.time for event in log.guard_events}
    last = 0.3 - PERIOD  # the last exposure
    assert last + 0.05 < started["measurement_held"] <= last + 0.05 + 4 * PERIOD
    assert last + 0.5 < started["stopped"] <= last + 0.5 + 4 * PERIOD
    speed = np.abs(log.velocity_command).max(axis=1)
    assert speed[np.searchsorted(log.time, 0.75)] > 0.1  # still on its way
    assert np.all(
        speed[log.time > started["stopped"] + 0.25 + PERIOD] == 0.0
    )  # stays stopped when it sees again
    braking = speed[(log.time >= started["stopped"]) & (log.time < started["stopped"] + 0.3)]
    assert np.all(np.diff(braking) <= 1e-12)
    assert np.all(np.abs(np.diff(log.position_command[-20:], axis=0)) == 0.0)
    assert counted(experiment)["stopped"] > 100


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_a_camera_that_is_later_than_the_longest_gap_still_serves(law: str):
    """What counts as a gap is the time between two arrivals, not how long a sample was on its way."""
    experiment = Experiment(scenario("misaligned", *QUIET, *SETTLE, RIGID, "station.camera.delay=0.06"), law)
    experiment.advance(3.0)
    assert "stopped" not in counted(experiment)
    assert np.abs(true_errors(experiment)[1][-1, 3:]).max() < 1e-4


def test_a_robot_that_runs_away_ends_the_simulation_with_a_reason():
    runaway = "station.drive.position.integral=100000"  # without damping it swings up
    experiment = Experiment(scenario("nominal", RIGID, runaway), "numerical_ik")
    with pytest.raises(RuntimeError, match=r"run away: a joint is faster than 105 rad/s at t = 0\.\d+ s"):
        experiment.advance(1.0)


def test_open_loop_does_not_mind_a_blind_camera():
    settings = ["reference.settle=0", "station.camera.dropouts=[[0.0, 30.0]]"]
    experiment = Experiment(scenario("misaligned", *settings, RIGID), "open_loop")
    experiment.advance(1.0)
    assert counted(experiment) == {}


@pytest.mark.parametrize("law", LAWS)
def test_one_false_detection_in_five_is_refused_and_counted(law: str):
    """Every fifth sample is half a metre off; the others show the tip where it is wanted."""
    config = scenario("nominal", *SETTLE, "initial_error_mm=[0, 0, 0]")
    X_WD = np.eye(4)

    def sample(time: float) -> PoseSample:
        tick = int(time / PERIOD + 1e-6)
        aside = [0.5, 0.0, 0.0] if tick % 5 == 4 else [0.0, 0.0, 0.0]
        X = pose(X_WD)
        return PoseSample(tick * PERIOD, RigidTransform(X.rotation(), X.translation() + aside), True)

    played = PlayedStation(config, law, sample)
    X_WD = played.servo.reference.path.sample(0.0)[0]
    _, positions, _, counts = played.run(1.0)
    np.testing.assert_allclose(positions, np.broadcast_to(played.start, positions.shape), atol=1e-9)
    assert counts["measurement_refused"][-1] == pytest.approx(50, abs=1)
    assert counts["measurement_held"][-1] == counts["stopped"][-1] == 0


@pytest.mark.parametrize("law", LAWS)
def test_nothing_but_false_detections_are_no_measurements_at_all(law: str):
    config = scenario("nominal", *SETTLE, "initial_error_mm=[0, 0, 0]")
    far = RigidTransform([5.0, 0.0, 0.0])
    played = PlayedStation(config, law, lambda t: PoseSample(int(t / PERIOD + 1e-6) * PERIOD, far, True))
    times, positions, velocities, counts = played.run(1.0)
    assert 0.05 < times[np.argmax(counts["measurement_held"] > 0)] <= 0.05 + 3 * PERIOD
    assert 0.5 < times[np.argmax(counts["stopped"] > 0)] <= 0.5 + 3 * PERIOD
    np.testing.assert_allclose(positions, np.broadcast_to(played.start, positions.shape), atol=1e-9)
    np.testing.assert_allclose(velocities, 0.0, atol=1e-9)


def test_a_correction_out_of_reach_is_no_command_and_the_robot_is_held():
    """The camera insists that the tip is 150 mm too near, until the arm is stretched."""
    corners = [f"{{translation_mm: [600, {y}, 600], zyx_deg: [90, 0, 90]}}" for y in (0, 100)]
    points = f"reference.path.waypoints=[{', '.join(corners)}]"
    settings = [
        *SETTLE,
        "initial_error_mm=[0, 0, 0]",
        "servo.laws.position_level.correction_limit=2.0",
        points,
    ]
    X_WD = np.eye(4)

    def sample(time: float) -> PoseSample:
        X = pose(X_WD)
        return PoseSample(
            int(time / PERIOD + 1e-6) * PERIOD,
            RigidTransform(X.rotation(), X.translation() - [0.15, 0, 0]),
            True,
        )

    played = PlayedStation(scenario("nominal", *settings), "position_level", sample)
    X_WD = played.servo.reference.path.sample(0.0)[0]
    _, positions, velocities, counts = played.run(2.5)
    assert counts["no_command"][-1] > 100
    assert counts["stopped"][-1] > 0
    assert np.isfinite(positions).all()
    np.testing.assert_array_equal(velocities[-10:], 0.0)
    np.testing.assert_array_equal(positions[-10:], np.broadcast_to(positions[-1], (10, 6)))
