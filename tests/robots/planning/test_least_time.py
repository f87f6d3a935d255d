"""A bound of the time: as closed forms where nothing but axis 1 moves, and below every motion."""

from dataclasses import replace

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.planning.jerk_profile import JerkProfile
from robots.planning.joint_path import straight_joint_path
from robots.planning.least_time import least_time, shortest
from robots.planning.limits import MotionLimits, motion_limits
from robots.planning.optimum import optimum
from robots.planning.path_dynamics import PathDynamics
from robots.planning.rigid_start import quickest_rigid, rigid_start

ANGLE = np.deg2rad(40.0)
FREE = np.full(6, np.inf)
STILL = np.array([np.inf, *np.full(5, 1e-9)])  # others cannot help
START = np.deg2rad([0.0, -90.0, 90.0, 0.0, 30.0, 0.0])
GOAL = START + np.array([ANGLE, 0.0, 0.0, 0.0, 0.0, 0.0])
ACROSS = np.deg2rad([[16.52, -54.41, 48.33, 0.0, 96.07, 16.52], [-16.52, -54.41, 48.33, 0.0, 96.07, -16.52]])


def alone(speed: np.ndarray, gear_torque: np.ndarray, gear_torque_rate: np.ndarray) -> MotionLimits:
    return MotionLimits(speed, FREE, FREE, FREE, FREE, gear_torque, gear_torque_rate)


@pytest.mark.slow
@pytest.mark.parametrize("top", [1.5, 3.0])
def test_axis_1_alone_takes_as_long_as_seven_segments_of_constant_jerk(top):
    robot = load_robot("kr16")
    dynamics = PathDynamics(robot, 16.0, straight_joint_path(START, GOAL), "rigid")
    rates = np.array([[0.5], [0.0], [1.0], [0.0], [0.0]])
    inertia = float(dynamics.demand(rates).gear_torque[0, 0]) / ANGLE
    acceleration, jerk = 8.0, 100.0  # rad/s^2, rad/s^3
    limits = alone(
        speed=np.minimum(STILL, top),
        gear_torque=acceleration * inertia * np.ones(6),
        gear_torque_rate=jerk * inertia * np.ones(6),
    )
    found = least_time(robot, 16.0, START, GOAL, limits)
    closed = JerkProfile(top / ANGLE, acceleration / ANGLE, jerk / ANGLE).duration
    assert found == pytest.approx(closed, rel=2e-3)  # a hundred intervals, and a thousandth of the time


def test_speed_and_acceleration_alone_have_a_closed_form():
    way, speed, acceleration = np.array([1.0, 1.0]), np.array([1.0, 10.0]), np.array([4.0, 4.0])
    assert shortest(way, speed, acceleration) == pytest.approx([1.25, 1.0])


@pytest.mark.slow
@pytest.mark.parametrize(("name", "payload"), [("kr16", 16.0), ("kr210", 210.0), ("irb1200", 5.0)])
def test_no_rigid_arm_is_quicker_on_any_straight_way(name, payload):
    robot, random = load_robot(name), np.random.default_rng(3)
    limits = replace(motion_limits(robot), gear_torque=FREE, gear_torque_rate=FREE, jerk=FREE)
    home = np.deg2rad([0.0, -60.0, 60.0, 0.0, 60.0, 0.0])
    start, goal = home + random.uniform(-0.5, 0.5, (2, 6))
    quickest, _ = quickest_rigid(robot, payload, straight_joint_path(start, goal), limits)
    assert 0.5 * quickest[-1] < least_time(robot, payload, start, goal, limits) < quickest[-1]


@pytest.mark.slow
def test_no_optimum_beats_it_and_more_of_a_limit_never_takes_longer():
    robot = load_robot("kr16")
    limits, path = motion_limits(robot), straight_joint_path(*ACROSS)
    bound = least_time(robot, 16.0, ACROSS[0], ACROSS[1], limits)
    found = optimum(
        PathDynamics(robot, 16.0, path, "elastic_structure"),
        limits,
        rigid_start(robot, 16.0, path, limits, 36),
    )
    assert bound < found.motion.duration
    more = replace(limits, gear_torque_rate=2.0 * limits.gear_torque_rate)
    assert least_time(robot, 16.0, ACROSS[0], ACROSS[1], more) < bound
