"""Free ways: never slower than the straight one, from end to end, through regions."""

from dataclasses import replace

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.planning.free_motion import FreeMotion, ViaRegion, free_motion
from robots.planning.joint_path import PathError, straight_joint_path
from robots.planning.limits import OVER_TIME, motion_limits
from robots.planning.optimum import optimum
from robots.planning.path_dynamics import PathDynamics
from robots.planning.rigid_start import rigid_start

START, GOAL = np.deg2rad([[-45.0, -10.0, 30.0, 0.0, 0.0, 0.0], [45.0, -60.0, 60.0, 0.0, 0.0, 0.0]])


def test_without_a_way_there_is_no_motion():
    robot = load_robot("kr16")
    with pytest.raises(PathError, match="no joint moves"):
        free_motion(robot, 16.0, START, START, motion_limits(robot))


def test_over_the_time_it_is_the_same_motion_and_at_rest_at_both_ends():
    shape = np.clip(np.linspace(-0.4, 1.4, 28), 0.0, 1.0)[:, None]  # six coefficients of rest at each end
    bump = np.array([0.0, 0.1, -0.2, 0.0, 0.3, 0.0]) * shape * (1.0 - shape)
    motion = FreeMotion(START + shape * (GOAL - START) + bump, 0.5, 0, "Solve_Succeeded")
    x = np.linspace(0.0, 1.0, 101)
    path = motion.over_time
    assert path.at(x) == pytest.approx(motion.at(x), abs=1e-6)  # a fifth of a micrometre a metre away
    assert path.at(np.array([0.0, 1.0])) == pytest.approx(np.array([START, GOAL]), abs=1e-12)
    for order in range(1, 6):
        size = np.abs(path.at(x, order)).max()
        assert path.at(np.array([0.0, 1.0]), order) == pytest.approx(0.0, abs=1e-6 * size)


@pytest.mark.slow
def test_limits_that_are_lower_at_some_times_are_kept_at_these():
    robot = load_robot("kr16")
    limits, shares = motion_limits(robot), np.ones((11, len(OVER_TIME), 6))
    shares[5:, OVER_TIME.index("motor_torque"), 0] = 0.5  # of axis 1, in the second half
    found = free_motion(robot, 16.0, START, GOAL, replace(limits, shares=shares))
    assert found.is_solved
    path, x = found.over_time, np.linspace(0.0, 1.0, 201)
    rates = np.array([x, np.full(201, 1.0 / found.duration), *np.zeros((3, 201))])
    torque = PathDynamics(robot, 16.0, path, "rigid", 100).demand(rates).motor_torque[:, 0]
    used = np.abs(torque) / limits.motor_torque[0]
    assert 0.9 < used[x < 0.4].max() <= 1.0
    assert used[x >= 0.5].max() <= 0.5


@pytest.mark.slow
def test_the_free_way_is_bent_and_the_same_arm_is_quicker_on_it():
    robot = load_robot("kr16")
    limits = motion_limits(robot)
    found = free_motion(robot, 16.0, START, GOAL, limits)
    assert found.is_solved
    assert found.iterations <= 60
    assert found.way.at(np.array([0.0, 1.0])) == pytest.approx(np.array([START, GOAL]), abs=1e-9)
    durations = []
    for path in (straight_joint_path(START, GOAL), found.way):
        dynamics = PathDynamics(robot, 16.0, path, "elastic_structure")
        durations.append(
            optimum(dynamics, limits, rigid_start(robot, 16.0, path, limits, 36)).motion.duration
        )
    assert durations[1] < 0.995 * durations[0]  # most of the gain is that of the timing


@pytest.mark.slow
def test_it_passes_a_region_that_is_not_on_its_way():
    robot = load_robot("kr16")
    limits, within = motion_limits(robot), np.deg2rad(5.0)
    middle = np.deg2rad([0.0, -60.0, 80.0, 0.0, 0.0, 0.0])
    s = np.linspace(0.0, 1.0, 400)
    free = free_motion(robot, 16.0, START, GOAL, limits)
    led = free_motion(robot, 16.0, START, GOAL, limits, (ViaRegion(middle, within),))
    off = [np.abs(found.way.at(s) - middle).max(axis=1).min() for found in (free, led)]
    assert off[0] > 2.0 * within
    assert off[1] < 1.02 * within  # what is handed on is a polynomial next to it
