"""What tells the motors of a planned motion, and what is left of it when it is over."""

import numpy as np
import pytest

from experiments.plan.legs import legs_of
from experiments.plan.plant_run import APPROXIMATE, STABLE, PlantDriver
from experiments.plan.timings import SineSquared
from robots.description.model import load_robot
from robots.planning.limits import motion_limits
from robots.planning.path_dynamics import PathDynamics

PAYLOAD = 16.0


def driver_along(path: str) -> PlantDriver:
    robot = load_robot("kr16")
    leg = legs_of(robot, path)[-1]
    return PlantDriver(robot, PAYLOAD, PathDynamics(robot, PAYLOAD, leg.path, "elastic_structure"))


@pytest.mark.slow
def test_the_arm_is_at_rest_after_a_line_in_half_a_second():
    run = driver_along("rectangle").run(SineSquared(0.45))
    assert run.inverse == STABLE
    assert run.criterion < 1e-3  # the planner's own inverse leaves some ten times as much
    before = run.times < 0.0
    assert np.abs(run.demand.speed[before]).max(initial=0.0) < 0.02 * np.abs(run.demand.speed).max()
    assert run.use(motion_limits(load_robot("kr16"))).largest < 1.0


@pytest.mark.slow
def test_a_stretched_arm_has_no_stable_inverse_and_is_driven_all_the_same():
    run = driver_along("joints").run(SineSquared(0.8))
    assert run.inverse == APPROXIMATE
    assert 0.0 <= run.times[0] < 0.004
    # The motors are where they shall be: 20 degrees from where they began.
    turned = np.rad2deg(np.trapezoid(run.demand.speed, run.times, axis=0))
    assert turned[:3] == pytest.approx(-20.0, abs=0.1)


def test_a_law_does_not_know_the_whole_motion_so_its_motion_is_tried_without_the_stable_inverse():
    robot = load_robot("kr16")
    dynamics = PathDynamics(robot, PAYLOAD, legs_of(robot, "rectangle")[0].path, "elastic_structure")
    assert PlantDriver(robot, PAYLOAD, dynamics, is_for_law=True).inverse == APPROXIMATE
    assert PlantDriver(robot, PAYLOAD, dynamics).inverse == STABLE
