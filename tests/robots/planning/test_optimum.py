"""Optimal motions against closed forms and against the best jerk-limited profile."""

from dataclasses import replace

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.planning.jerk_profile import JerkProfile, best_jerk_profile
from robots.planning.joint_path import straight_joint_path
from robots.planning.limit_use import energy, use_of
from robots.planning.limits import OVER_TIME, MotionLimits, motion_limits
from robots.planning.optimum import optimum
from robots.planning.path_dynamics import PathDynamics
from robots.planning.rigid_start import quickest_rigid, rigid_start
from robots.planning.time_spline import TimeSpline, at_rest

ANGLE = np.deg2rad(40.0)
FREE = np.full(6, np.inf)
_ROUGHEST = 1e-6
_ROUGH = 2e-3  # of the usual weight: a closed form knows no drive that has to follow


@pytest.fixture(scope="module")
def robot():
    return load_robot("kr16")


def limits(**given) -> MotionLimits:
    every = (
        "speed",
        "acceleration",
        "jerk",
        "motor_torque",
        "continuous_torque",
        "gear_torque",
        "gear_torque_rate",
    )
    return MotionLimits(**{name: given.get(name, FREE) for name in every})


def axis_1(robot) -> PathDynamics:
    """Axis 1 alone: neither gravity nor a change of inertia, so torque is proportional to acceleration."""
    start, goal = np.deg2rad([0.0, -90.0, 90.0, 0.0, 30.0, 0.0]), np.zeros(6)
    goal[:] = start
    goal[0] = ANGLE
    return PathDynamics(robot, 16.0, straight_joint_path(start, goal), "rigid")


def inertia(dynamics) -> float:
    return float(dynamics.demand(np.array([[0.5], [0.0], [1.0], [0.0], [0.0]])).gear_torque[0, 0]) / ANGLE


@pytest.mark.slow
def test_with_limited_torque_and_rate_it_takes_as_long_as_the_closed_form(robot):
    dynamics = axis_1(robot)
    acceleration, jerk = 8.0, 100.0  # rad/s^2, rad/s^3
    of_torque = inertia(dynamics) * np.array([1.0, *FREE[1:]])
    wanted = JerkProfile(1e3, acceleration / ANGLE, jerk / ANGLE).duration
    kept = limits(
        gear_torque=acceleration * of_torque, gear_torque_rate=jerk * of_torque, speed=np.full(6, 50.0)
    )
    start = rigid_start(robot, 16.0, dynamics.path, replace(kept, acceleration=np.full(6, acceleration)), 160)
    found = optimum(dynamics, kept, start, smoother=_ROUGHEST)
    assert found.status == "Solve_Succeeded"
    # What five continuous derivatives cost where the closed form has jumps of the jerk.
    assert wanted * 0.999 < found.motion.duration < wanted * 1.005


@pytest.mark.slow
def test_with_limited_torque_alone_it_comes_near_bang_bang(robot):
    """2 sqrt(S / a), which no motion with five continuous derivatives reaches."""
    dynamics, acceleration = axis_1(robot), 8.0
    kept = limits(acceleration=np.full(6, acceleration), speed=np.full(6, 50.0))
    wanted = 2.0 * np.sqrt(ANGLE / acceleration)
    times, s = quickest_rigid(robot, 16.0, dynamics.path, kept)
    assert times[-1] == pytest.approx(wanted, rel=2e-3)
    assert s[len(s) // 2] == pytest.approx(0.5, abs=0.01)
    durations = [
        optimum(
            dynamics, kept, rigid_start(robot, 16.0, dynamics.path, kept, count), smoother=smoother
        ).motion.duration
        for count, smoother in ((46, _ROUGH), (220, _ROUGHEST))
    ]
    # Each of the three jumps takes some intervals of the spline: the more, the nearer.
    assert wanted < durations[1] < wanted * 1.005
    assert durations[1] < durations[0] < wanted * 1.03


@pytest.mark.slow
@pytest.mark.parametrize("recuperation", [False, True])
def test_more_time_takes_less_energy(robot, recuperation):
    dynamics, kept = axis_1(robot), motion_limits(robot)
    start = rigid_start(robot, 16.0, dynamics.path, kept, 30)
    works = []
    for share in (1.1, 1.5, 2.0):
        found = optimum(dynamics, kept, start, "energy", recuperation, share * start.duration)
        demand = dynamics.demand(found.motion.rates(found.motion.times))
        works.append(energy(demand, found.motion.times, recuperation))
        assert found.motion.duration == pytest.approx(share * start.duration)
    assert works[0] > works[1] > works[2] > 0.0


def test_the_least_energy_needs_a_duration(robot):
    with pytest.raises(ValueError, match="needs a duration"):
        optimum(axis_1(robot), motion_limits(robot), TimeSpline(at_rest(30), 1.0), "energy")


@pytest.mark.slow
def test_quicker_and_more_frugal_than_the_best_jerk_profile_in_the_same_limits(robot):
    path = straight_joint_path(np.zeros(6), np.deg2rad([-20.0, -20.0, -20.0, 0.0, 0.0, 0.0]))
    dynamics, kept = PathDynamics(robot, 16.0, path, "elastic_structure"), motion_limits(robot)
    base = best_jerk_profile(dynamics, kept)
    quick = optimum(dynamics, kept, rigid_start(robot, 16.0, path, kept, 46), smoother=_ROUGH)
    frugal = optimum(dynamics, kept, quick.motion, "energy", duration=base.duration)
    used = [
        use_of(dynamics.demand(each.rates(each.times)), kept, each.times)
        for each in (base, quick.motion, frugal.motion)
    ]
    work = [energy(dynamics.demand(each.rates(each.times)), each.times) for each in (base, frugal.motion)]
    assert max(use.largest for use in used) < 1.01
    assert "rate of gear torque 1" in used[1].binding
    assert quick.motion.duration < 0.92 * base.duration
    assert work[1] < 0.85 * work[0]
    assert max(quick.iterations, frugal.iterations) <= 60


def test_a_limit_that_is_lower_for_a_while_is_kept_then_and_used_otherwise(robot):
    """Axis 1, whose torque may change less in the first third: slower than without, not as if throughout."""
    dynamics = axis_1(robot)
    of_torque = inertia(dynamics) * np.array([1.0, *FREE[1:]])
    whole = limits(gear_torque=8.0 * of_torque, gear_torque_rate=100.0 * of_torque, speed=np.full(6, 50.0))
    shares = np.ones((4, len(OVER_TIME), 6))
    shares[:2, OVER_TIME.index("gear_torque_rate")] = 0.5
    first, throughout = replace(whole, shares=shares), replace(whole, gear_torque_rate=50.0 * of_torque)
    found = {}
    for name, kept in (("whole", whole), ("first", first), ("throughout", throughout)):
        start = rigid_start(robot, 16.0, dynamics.path, replace(kept, acceleration=np.full(6, 8.0)), 60)
        best = optimum(dynamics, kept, start, smoother=_ROUGHEST)
        assert best.is_solved
        found[name] = best.motion
    motion = found["first"]
    assert found["whole"].duration < motion.duration < found["throughout"].duration
    used = np.abs(dynamics.demand(motion.rates(motion.times)).gear_torque_rate[:, 0])
    used /= whole.gear_torque_rate[0]
    is_first = motion.times < motion.duration / 3.0
    assert used[is_first].max() == pytest.approx(0.5, abs=0.02)
    assert used[~is_first].max() == pytest.approx(1.0, abs=0.02)


@pytest.mark.slow
def test_a_slow_tool_takes_little_more_than_the_length_over_its_speed(robot):
    dynamics, speed = axis_1(robot), 0.05
    evenly = np.array([[0.5], [1.0], [0.0], [0.0], [0.0]])
    least = float(dynamics.demand(evenly).tool_speed[0]) / speed
    kept = motion_limits(robot, tool_speed=speed)
    times, _ = quickest_rigid(robot, 16.0, dynamics.path, kept)
    # Of 100 intervals the first and the last take twice as long.
    assert times[-1] == pytest.approx(1.02 * least, rel=2e-3)
    usual = best_jerk_profile(dynamics, kept)
    found = optimum(dynamics, kept, rigid_start(robot, 16.0, dynamics.path, kept, 36))
    assert found.is_solved
    for motion in (usual, found.motion):
        assert least < motion.duration < 1.1 * least
        assert dynamics.demand(motion.rates(motion.times)).tool_speed.max() < 1.005 * speed


@pytest.mark.slow
def test_the_acceleration_of_a_tool_may_be_small(robot):
    """Bang-bang, 2 sqrt(S / a), is the least, but on an arc some of it points to the centre."""
    dynamics, acceleration = axis_1(robot), 0.02
    evenly = np.array([[0.5], [1.0], [0.0], [0.0], [0.0]])
    least = 2.0 * np.sqrt(float(dynamics.demand(evenly).tool_speed[0]) / acceleration)
    kept = motion_limits(robot, tool_acceleration=acceleration)
    usual = best_jerk_profile(dynamics, kept)
    assert least < usual.duration < 1.15 * least
    assert dynamics.demand(usual.rates(usual.times)).tool_acceleration.max() < 1.005 * acceleration


@pytest.mark.parametrize("smoother", [1.0, 10.0])
def test_the_ends_of_a_long_motion_take_no_larger_share_of_it(robot, smoother: float):
    """At a tenth of the speed a motion takes some ten times as long, not fourteen times."""
    dynamics = axis_1(robot)
    kept = replace(motion_limits(robot), speed=0.1 * robot.speed)
    start = rigid_start(robot, 16.0, dynamics.path, kept, 36)
    found = optimum(dynamics, kept, start, smoother=smoother)
    assert found.is_solved
    assert found.motion.duration < 1.15 * ANGLE / kept.speed[0]


def test_a_jerk_limited_profile_is_looked_at_where_its_acceleration_is_largest(robot):
    profile = JerkProfile(0.27, 23.0, 1900.0)
    assert profile.rates(profile.times)[2].max() == pytest.approx(np.sqrt(0.27 * 1900.0), rel=1e-6)
