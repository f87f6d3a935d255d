"""Free ways: never slower than the straight one, from end to end, through regions."""

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.planning.free_motion import ViaRegion, free_way
from robots.planning.joint_path import PathError, straight_joint_path
from robots.planning.limits import motion_limits
from robots.planning.optimum import optimum
from robots.planning.path_dynamics import PathDynamics
from robots.planning.rigid_start import rigid_start

START, GOAL = np.deg2rad([[-45.0, -10.0, 30.0, 0.0, 0.0, 0.0], [45.0, -60.0, 60.0, 0.0, 0.0, 0.0]])


def test_without_a_way_there_is_no_motion():
    robot = load_robot("kr16")
    with pytest.raises(PathError, match="no joint moves"):
        free_way(robot, 16.0, START, START, motion_limits(robot))


@pytest.mark.slow
def test_the_free_way_is_bent_and_the_same_arm_is_quicker_on_it():
    robot = load_robot("kr16")
    limits = motion_limits(robot)
    way = free_way(robot, 16.0, START, GOAL, limits)
    assert way.status == "Solve_Succeeded"
    assert way.iterations <= 60
    assert way.path.at(np.array([0.0, 1.0])) == pytest.approx(np.array([START, GOAL]), abs=1e-9)
    durations = []
    for path in (straight_joint_path(START, GOAL), way.path):
        dynamics = PathDynamics(robot, 16.0, path, "elastic_structure")
        durations.append(
            optimum(dynamics, limits, rigid_start(robot, 16.0, path, limits, 36)).motion.duration
        )
    assert durations[1] < 0.99 * durations[0]


@pytest.mark.slow
def test_it_passes_a_region_that_is_not_on_its_way():
    robot = load_robot("kr16")
    limits, within = motion_limits(robot), np.deg2rad(5.0)
    middle = np.deg2rad([0.0, -60.0, 80.0, 0.0, 0.0, 0.0])
    s = np.linspace(0.0, 1.0, 400)
    free = free_way(robot, 16.0, START, GOAL, limits)
    led = free_way(robot, 16.0, START, GOAL, limits, (ViaRegion(middle, within),))
    off = [np.abs(way.path.at(s) - middle).max(axis=1).min() for way in (free, led)]
    assert off[0] > 2.0 * within
    assert off[1] < 1.02 * within  # what is handed on is a polynomial next to it
