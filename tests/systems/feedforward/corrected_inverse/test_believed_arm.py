"""The forward model that is believed: against Drake's simulation of the same robot, and its derivatives."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from diagrams.runs.simulation import run
from experiments.feedforward.line_end import LAW, line_scenario, trial
from robots.description.model import NUM_JOINTS, load_robot
from systems.feedforward.corrected_inverse.believed_arm import BelievedArm
from systems.feedforward.corrected_inverse.resting_places import Resting
from systems.feedforward.joint_motion import Standing

ROBOT, STEP, EVERY = load_robot("kr16-realistic"), 1e-3, 4
LOAD = ROBOT.payload.largest_mass
AXES = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


def swung() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, positions and velocities of motors that turn axes 1 to 3 by two degrees in 0.2 s."""
    times = STEP * np.arange(301)
    x = np.clip((times - 0.05) / 0.2, 0.0, 1.0)
    turn = np.deg2rad(2.0) * (x - np.sin(2.0 * np.pi * x) / (2.0 * np.pi))
    speed = np.deg2rad(2.0) / 0.2 * (1.0 - np.cos(2.0 * np.pi * x))
    home = np.deg2rad([10.0, -60.0, 80.0, 0.0, 40.0, 0.0])
    return times, home + turn[:, None] * AXES, speed[:, None] * AXES


@pytest.mark.slow
def test_derivatives_are_those_of_differences():
    """Also through the play of the gears, which axis 1 crosses here: where it does is a matter of course."""
    times, theta, rate = swung()
    arm = BelievedArm(ROBOT, LOAD, STEP, EVERY)
    arm.set_motion(theta, rate)
    shape = np.exp(-0.5 * ((times - 0.12) / 0.03) ** 2)
    slope = -(times - 0.12) / 0.03**2 * shape
    still = np.zeros((len(times), NUM_JOINTS))
    shapes = np.stack([shape, slope], axis=1)[:, :, None]
    course = arm.course(still, still, shapes)
    for joint in range(3):
        axis, turn = np.eye(NUM_JOINTS)[joint], 1e-7
        offset, speed = (turn * each[:, None] * axis for each in (shape, slope))
        ahead, behind = (arm.course(sign * offset, sign * speed).tip for sign in (1.0, -1.0))
        difference = (ahead - behind) / (2.0 * turn)
        found = course.derived[:, :, joint]
        assert found == pytest.approx(difference, abs=0.01 * np.abs(difference).max())


def test_an_arm_at_rest_stays_at_rest():
    _, theta, _ = swung()
    still = np.zeros((len(theta), NUM_JOINTS))
    arm = BelievedArm(ROBOT, LOAD, STEP, EVERY)
    arm.set_motion(np.tile(theta[0], (len(theta), 1)), still)
    course = arm.course(still, still)
    assert np.ptp(course.tip, axis=0) == pytest.approx(0.0, abs=1e-7)  # m
    assert np.ptp(course.torque, axis=0) == pytest.approx(0.0, abs=0.5)  # N m


def test_a_gear_without_load_rests_where_it_is_put_in_its_play():
    """Axis 1 stands upright: the tip is off by the play times its distance from it, and stays there."""
    _, theta, _ = swung()
    theta = np.tile(theta[0], (100, 1))
    still = np.zeros_like(theta)
    arm = BelievedArm(ROBOT, LOAD, STEP, EVERY)
    arm.set_motion(theta, still)
    assert list(arm.unloaded) == [True] + 5 * [False]
    one, other = (arm.course(still, still, None, Resting(place, 1.5)).tip for place in (-1.0, 1.0))
    assert ROBOT.drive_trains is not None
    width = 2.0 * 1.5 * ROBOT.drive_trains.half_gap[0]
    distances = np.linalg.norm(other - one, axis=1)
    assert distances == pytest.approx(width * np.linalg.norm(one[0, :2]), rel=1e-3)


@pytest.mark.parametrize("place", [-0.4, 0.0, 0.5])
def test_a_camera_that_sees_the_tip_at_rest_tells_where_in_its_play(place: float):
    _, theta, _ = swung()
    theta = np.tile(theta[0], (10, 1))
    still = np.zeros_like(theta)
    arm = BelievedArm(ROBOT, LOAD, STEP, EVERY)
    arm.set_motion(theta, still)
    seen = arm.course(still, still, None, Resting(place, 1.0)).tip[0]
    found = next(each for each in arm.seen_resting(Standing(theta[0], seen)) if each.play == 1.0)
    assert found.place == pytest.approx((place, 0.0, 0.0, 0.0, 0.0, 0.0), abs=0.02)


@pytest.mark.slow
def test_behind_the_same_motors_the_tip_moves_as_drake_has_it():
    """To a tenth of how it rings; what is left is where in its play an axis without load began."""
    scenario = line_scenario(trial(ROBOT, ROBOT, "elastic_structure", "none"), 1)
    log = run(scenario, LAW, ROBOT, plant=ROBOT)
    path = CubicSpline(log.time, log.joint_position)
    begin = round((log.path_start - 0.1) / scenario.station.period)
    times = log.time[begin] + STEP * np.arange((len(log.time) - 1 - begin) * EVERY + 1)
    arm = BelievedArm(ROBOT, LOAD, STEP, EVERY)
    arm.set_motion(path(times), path(times, 1))
    still = np.zeros((len(times), NUM_JOINTS))
    simulated, true = arm.course(still, still).tip, log.X_WE_true[begin:, :3, 3]
    after = log.time[begin:] > log.dwell_start
    ringing, gap = (each[after] - each[-1] for each in (true, simulated - true))
    assert np.linalg.norm(gap, axis=1).max() < 0.1 * np.linalg.norm(ringing, axis=1).max()
