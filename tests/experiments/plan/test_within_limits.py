"""Where the plant exceeds limits the planner has lower ones the next time, and nowhere else."""

from dataclasses import fields

import numpy as np
import pytest

from experiments.plan.plant_run import PlantRun
from experiments.plan.within_limits import lowered, lowered_there
from robots.description.model import load_robot
from robots.planning.limits import OVER_TIME, motion_limits
from robots.planning.path_dynamics import Demand

LIMITS = motion_limits(load_robot("kr210"))
DURATION, RATE, JOINT = 0.6, OVER_TIME.index("gear_torque_rate"), 3
TIMES = np.arange(-0.02, DURATION + 0.3, 0.004)


def exceeding(time: float, share: float) -> PlantRun:
    """A motion in which nothing is asked for, but for one rate of gear torque at one time."""
    size = {"tool_speed": (len(TIMES),), "tool_acceleration": (len(TIMES),)}
    demand = Demand(**{each.name: np.zeros(size.get(each.name, (len(TIMES), 6))) for each in fields(Demand)})
    at = int(np.abs(TIMES - time).argmin())
    demand.gear_torque_rate[at, JOINT] = share * LIMITS.gear_torque_rate[JOINT]
    return PlantRun(TIMES, demand, 0.0, DURATION, "stable")


def test_a_limit_is_lowered_about_the_time_at_which_it_was_exceeded():
    margins = lowered_there(LIMITS, exceeding(0.1, 1.3), LIMITS)
    shares = margins.shares_at(np.array([0.0, 0.1, 0.2, 0.5, 1.0]) / DURATION)
    assert shares[1, RATE, JOINT] == pytest.approx((0.995 / 1.3) ** 1.1)
    shares[1, RATE, JOINT] = 1.0
    assert (shares == 1.0).all()
    assert (margins.gear_torque_rate == LIMITS.gear_torque_rate).all()


def test_and_further_if_it_is_exceeded_again():
    once = lowered_there(LIMITS, exceeding(0.1, 1.3), LIMITS)
    twice = lowered_there(once, exceeding(0.1, 1.1), LIMITS)
    x = np.array([0.1 / DURATION])
    assert twice.shares_at(x)[0, RATE, JOINT] < once.shares_at(x)[0, RATE, JOINT] < 1.0


def test_what_rings_after_the_end_no_time_of_the_motion_is_to_blame_for():
    margins = lowered_there(LIMITS, exceeding(DURATION + 0.05, 1.3), LIMITS)
    assert margins.gear_torque_rate[JOINT] == pytest.approx(0.995 / 1.3 * LIMITS.gear_torque_rate[JOINT])
    assert (margins.shares == 1.0).all()


def too_quick(links: float) -> PlantRun:
    """A motor at 1.2 times its largest speed at 0.1 s, while its link has a share of this."""
    run = exceeding(0.1, 0.0)
    at = int(np.abs(TIMES - 0.1).argmin())
    moving = (TIMES > 0.0) & (np.arange(len(TIMES)) <= at)
    run.demand.acceleration[moving, JOINT] = links * LIMITS.speed[JOINT] / TIMES[at]
    run.demand.jerk[moving, JOINT] = 50.0
    run.demand.speed[at, JOINT] = 1.2 * LIMITS.speed[JOINT]
    return run


def test_a_motor_that_is_too_quick_because_its_gear_rings_gets_less_jerk_and_keeps_its_speed():
    margins = lowered(LIMITS, too_quick(0.3), LIMITS)
    assert margins.jerk[JOINT] < 50.0
    assert np.isinf(np.delete(margins.jerk, JOINT)).all()
    assert (margins.speed == LIMITS.speed).all()


def test_one_that_is_too_quick_with_its_link_gets_less_speed():
    margins = lowered(LIMITS, too_quick(1.15), LIMITS)
    assert margins.speed[JOINT] == pytest.approx(0.995 / 1.2 * LIMITS.speed[JOINT])
    assert np.isinf(margins.jerk).all()


def test_what_was_lowered_in_vain_is_lowered_for_all_joints():
    margins = lowered(LIMITS, exceeding(0.1, 1.3), LIMITS, of_all_joints=True)
    assert margins.gear_torque_rate == pytest.approx(0.995 / 1.3 * LIMITS.gear_torque_rate)
    assert (margins.motor_torque == LIMITS.motor_torque).all()
