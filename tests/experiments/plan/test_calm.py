"""A motion that gives a little time away rings far less in the plant."""

import numpy as np
import pytest

from experiments.plan.plant_run import PlantDriver
from robots.description.model import load_robot
from robots.planning.joint_path import straight_joint_path
from robots.planning.limits import motion_limits
from robots.planning.optimum import calmed, optimum
from robots.planning.path_dynamics import PathDynamics
from robots.planning.rigid_start import rigid_start
from robots.planning.ringing import ringing_band

SWING = np.deg2rad([0.0, -60.0, 60.0, 0.0, 30.0, 0.0]), np.deg2rad([20.0, -60.0, 60.0, 0.0, 30.0, 0.0])


@pytest.mark.slow
def test_a_calm_motion_keeps_the_limits_and_rings_less_in_the_plant():
    robot = load_robot("kr16")
    path, limits = straight_joint_path(*SWING), motion_limits(robot).scaled(0.9)
    dynamics = PathDynamics(robot, 16.0, path, "elastic_structure")
    driver = PlantDriver(robot, 16.0, dynamics)
    quick = optimum(dynamics, limits, rigid_start(robot, 16.0, path, limits, 36))
    calm = calmed(dynamics, limits, quick, ringing_band(robot, 16.0, path), slower=0.1)
    assert calm.is_solved
    assert calm.motion.duration == pytest.approx(1.1 * quick.motion.duration)
    rings = [driver.run(each.motion) for each in (quick, calm)]
    assert rings[1].criterion < 0.6 * rings[0].criterion
    assert rings[1].use(motion_limits(robot)).largest < 1.0
