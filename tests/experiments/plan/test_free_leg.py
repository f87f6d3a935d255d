"""A free way is no slower than the straight one, and keeps clear of what stands there."""

import numpy as np
import pytest

from experiments.plan.free_leg import blended, free_legs
from experiments.plan.legs import Leg
from robots.description.model import load_robot
from robots.description.placement import Placement
from robots.kinematics.forward import Kinematics
from robots.measurement_design.constraints import AdmissibleConfigurations
from robots.measurement_design.obstacles import Obstacle
from robots.planning.joint_path import Curve, PathError, straight_joint_path
from robots.planning.limits import motion_limits
from robots.planning.optimum import optimum
from robots.planning.path_dynamics import PathDynamics
from robots.planning.rigid_start import rigid_start

START, GOAL = np.deg2rad([[-30.0, 0.0, 0.0, 0.0, 0.0, 0.0], [30.0, 0.0, 0.0, 0.0, 0.0, 0.0]])


def test_a_bend_of_nothing_is_straight_and_of_one_the_whole():
    straight = straight_joint_path(START, GOAL)
    bent = Curve(np.vstack([straight.coefficients, np.full((2, 6), 0.1)]))
    s = np.linspace(0.0, 1.0, 7)
    assert blended(straight, bent, 0.0).at(s) == pytest.approx(straight.at(s))
    assert blended(straight, bent, 1.0).at(s) == pytest.approx(bent.at(s))


@pytest.mark.slow
def test_the_way_is_clear_and_no_slower_than_the_straight_one_and_what_is_blocked_is_refused():
    robot = load_robot("kr16")
    leg, limits = Leg("swing", straight_joint_path(START, GOAL), False), motion_limits(robot)
    found = free_legs(robot, 16.0, leg, limits, "rigid")[0]
    durations = [
        optimum(
            PathDynamics(robot, 16.0, each.path, "rigid"),
            limits,
            rigid_start(robot, 16.0, each.path, limits, 36),
        ).motion.duration
        for each in (found, leg)
    ]
    assert durations[0] <= durations[1]
    assert AdmissibleConfigurations(robot)(found.path.at(np.linspace(0.0, 1.0, 101))).all()
    middle = Kinematics(robot).forward(leg.path.at(np.array([0.5])))[0, :3, 3]
    wall = Obstacle("wall", np.array([0.6, 0.02, 3.0]), Placement(middle))
    with pytest.raises(PathError, match=r"an obstacle at \d\d % of the way"):
        free_legs(robot, 16.0, leg, limits, "rigid", (wall,))
