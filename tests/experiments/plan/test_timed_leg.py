"""Joints that are timed one by one: the plant keeps the limits, and nothing along a given way is quicker."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.plan.legs import legs_of
from experiments.plan.plant_run import PlantRun
from experiments.plan.study import Plan, study_legs
from experiments.plan.timings import EvenTiming
from experiments.plan.within_limits import adapted, largest_share
from robots.description.model import load_robot
from robots.planning.limits import OVER_TIME, MotionLimits, motion_limits
from robots.planning.path_dynamics import Demand

# 754 mm across, level, in mm and degrees.
ACROSS = "x_mm,y_mm,z_mm,alpha_deg,beta_deg,gamma_deg\n1271,-377,1106,180,0,180\n1271,377,1106,180,0,180\n"
TIMES = np.linspace(0.0, 1.0, 101)


def demand(speed: np.ndarray) -> Demand:
    """Only axis 1 moves, at so much of its speed."""
    nothing = np.zeros((len(speed), 6))
    moving = nothing.copy()
    moving[:, 0] = speed
    return Demand(moving, *[nothing] * 5, *[np.zeros(len(speed))] * 2)


def next_shares(driven: np.ndarray, is_raised: bool = True) -> np.ndarray:
    """Of the speed of axis 1, where the planner is at its limit in the first half."""
    ones = np.ones(6)
    limits = MotionLimits(ones, ones, ones, ones, ones, ones, ones)
    planned = demand(np.where(TIMES < 0.5, 1.0, 0.5))
    run = PlantRun(TIMES, demand(driven), 0.0, 1.0, "stable")
    found = adapted(limits, run, planned, limits, 1.0, is_raised)
    return found.shares_at(np.array([0.2, 0.8]))[:, OVER_TIME.index("speed"), 0]


def test_limits_are_lower_where_the_plant_exceeds_them_and_higher_where_only_the_planner_is_held_back():
    assert next_shares(np.where(TIMES < 0.5, 1.1, 0.5)) == pytest.approx([0.998 / 1.1, 1.0])
    assert next_shares(np.full(101, 0.99)) == pytest.approx([0.998 / 0.99, 1.0])
    assert next_shares(np.full(101, 0.99), is_raised=False) == pytest.approx([1.0, 1.0])


def test_an_even_timing_is_at_rest_as_far_as_its_path_is():
    rates = EvenTiming(2.0).rates(np.array([0.0, 1.0, 2.0]))
    assert rates[:3] == pytest.approx(np.array([[0.0, 0.5, 1.0], [0.5] * 3, [0.0] * 3]))


@pytest.mark.slow
def test_joints_timed_one_by_one_keep_the_limits_and_are_quicker_than_along_a_way(tmp_path: Path):
    (tmp_path / "across.csv").write_text(ACROSS)
    robot = load_robot("kr16")
    limits, (leg,) = motion_limits(robot), legs_of(robot, str(tmp_path / "across.csv"), ())
    plan = Plan(robot, 16.0, "across", "time", "elastic_structure", limits, may_ring=True, is_free=True)
    (timed,) = study_legs(plan, [leg])
    assert isinstance(timed.planned.timing, EvenTiming)
    assert largest_share(timed.planned.run, limits) <= 1.0 + 1e-6
    ends = np.array([0.0, 1.0])
    assert timed.leg.path.at(ends) == pytest.approx(leg.path.at(ends), abs=1e-9)
    # A limit of the tool is one that only a timing along a way keeps; this one never binds.
    (along,) = study_legs(replace(plan, limits=replace(limits, tool_speed=100.0)), [leg])
    assert timed.planned.timing.duration < 0.99 * along.planned.timing.duration
