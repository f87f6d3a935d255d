"""Where a robot file gives a largest jerk it is kept from command to command, whatever fails."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.description.model import RobotModel, load_robot
from systems.guard.guard import GuardConfig
from systems.guard.jerk_limits import JerkLimits
from systems.guard.joint_limits import JointLimits
from systems.guard.message_guard import MessageGuard
from tests.systems.guard.test_faults import MIDDLE, Swing, sequences
from tests.systems.rigs import PERIOD

SLACK = 1.0 + 1e-6


def with_jerk(jerk: float) -> RobotModel:
    """In rad/s^3, of all joints but the third, which has none."""
    robot = load_robot("irb1200")
    for joint in robot.joints:
        joint.limits.jerk_deg_s3 = float(np.rad2deg(jerk))
    robot.joints[2].limits.jerk_deg_s3 = 0.0
    return robot


def assert_jerk(robot: RobotModel, positions: np.ndarray, velocities: np.ndarray) -> None:
    """Of commands (n, 6) in rad and rad/s, a period apart."""
    bends = np.abs(np.diff(positions, 3, axis=0))
    assert (bends <= JointLimits(robot).jerk * PERIOD**3 * SLACK + 1e-12).all()
    assert (
        np.abs(np.diff(velocities, 2, axis=0)) <= JointLimits(robot).jerk * PERIOD**2 * SLACK + 1e-11
    ).all()


@pytest.mark.parametrize("jerk", [300.0, 4000.0])
def test_a_step_is_made_in_the_shortest_time_that_the_jerk_allows(jerk: float):
    """From rest to rest in 4 (d / 2 j)^(1/3), if neither speed nor acceleration come to their limits.

    Steps are coarse where that is a few periods: some more are needed to come to rest exactly there.
    """
    robot, distance = with_jerk(jerk), 0.02
    rig = Swing(0.0, GuardConfig(), robot=robot)
    for _ in range(150):
        rig.tick("jump", distance)
    rig.check()
    positions = np.array(rig.positions)
    assert_jerk(robot, positions, np.array(rig.velocities))
    np.testing.assert_allclose(positions[-1], MIDDLE + distance, atol=1e-12)
    arrived = np.flatnonzero(np.abs(positions[:, 0] - MIDDLE[0] - distance) > 1e-3 * distance)[-1] * PERIOD
    shortest = 4.0 * np.cbrt(distance / (2.0 * jerk))
    assert 0.9 * shortest < arrived < 1.1 * shortest + 8 * PERIOD


def test_ordinary_motion_passes_unchanged():
    robot = with_jerk(2000.0)
    rig = Swing(0.05, GuardConfig(), robot=robot)
    for _ in range(300):
        rig.tick()
    assert rig.counts["acceleration_limit"] <= 3  # at its first tick
    assert_jerk(robot, np.array(rig.positions[3:]), np.array(rig.velocities[3:]))


drawn = given(
    sequence=sequences,
    share=st.floats(0.02, 0.6),
    jerk=st.sampled_from([300.0, 3000.0]),
    resume=st.booleans(),
    is_speed_only=st.booleans(),
)


def check(sequence, share: float, jerk: float, resume: bool, is_speed_only: bool) -> None:
    config = GuardConfig(hold_after=0.02, stop_after=0.06, stop_time=0.05, resume=resume, resume_time=0.05)
    robot = with_jerk(jerk)
    swing = Swing(share, config, robot=robot, is_speed_only=is_speed_only)
    for fault, ticks, size in sequence:
        for _ in range(ticks):
            swing.tick(fault, size if fault in ("jump", "beyond") else 0.0)
    velocities = np.array(swing.velocities)
    if is_speed_only:
        assert (np.abs(np.diff(velocities, axis=0)) <= robot.acceleration * PERIOD * SLACK).all()
        assert_jerk(robot, np.zeros((4, 6)), velocities)
    else:
        swing.check()
        assert_jerk(robot, np.array(swing.positions), velocities)


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@drawn
def test_no_sequence_of_faults_jerks_a_joint(sequence, share, jerk, resume, is_speed_only):
    check(sequence, share, jerk, resume, is_speed_only)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@drawn
def test_nor_does_one_of_many_sequences(sequence, share, jerk, resume, is_speed_only):
    check(sequence, share, jerk, resume, is_speed_only)


@pytest.mark.parametrize("jerk", [300.0, 4000.0])
def test_messages_keep_it_too_and_so_does_their_stop(jerk: float):
    robot, random = with_jerk(jerk), np.random.default_rng(0)
    guard = MessageGuard(JointLimits(robot), PERIOD, False)
    guard.forget(MIDDLE)
    sent = [(MIDDLE, np.zeros(6))] * 3
    for _ in range(40):
        goal, rate = MIDDLE + random.uniform(-0.5, 0.5, 6), random.uniform(-1.0, 1.0, 6)
        sent += [guard.judged(goal + k * PERIOD * rate, rate, PERIOD) for k in range(8)]
    while not guard.is_at_rest:
        sent.append(guard.braking(PERIOD, 0.1))
        assert len(sent) < 1000
    assert_jerk(robot, *(np.array(part) for part in zip(*sent, strict=True)))


@pytest.mark.slow
@pytest.mark.parametrize("jerk", [300.0, 3000.0])
def test_however_long_it_is_from_message_to_message_speed_acceleration_and_range_are_kept(jerk: float):
    robot, random = with_jerk(jerk), np.random.default_rng(0)
    for spans in random.uniform(5e-4, 0.032, (12, 4)):
        guard = MessageGuard(JointLimits(robot), PERIOD, False)
        guard.forget(MIDDLE)
        position, rate, sent = MIDDLE, np.zeros(6), [MIDDLE]
        passed = random.choice(spans, 400)
        for span in passed:
            rate = np.minimum(rate + 0.5 * span * robot.acceleration, robot.speed)
            position = position + span * rate
            sent.append(guard.judged(position, rate, float(span))[0])
        means = np.diff(sent, axis=0) / passed[:, None]
        turns = np.abs(np.diff(means, axis=0)) / (0.5 * (passed[1:] + passed[:-1])[:, None])
        assert (np.abs(means) <= robot.speed * SLACK).all()
        assert (turns <= robot.acceleration * SLACK + 1e-9).all()
        assert (np.array(sent) <= robot.upper).all()


@pytest.mark.slow
def test_a_joint_brakes_before_the_end_of_its_range():
    """It is led beyond with all its speed, and stops short of the end by less than two degrees."""
    robot = with_jerk(1000.0)
    limits = JointLimits(robot)
    jerk, q, speed, turning = JerkLimits(limits), MIDDLE, np.zeros(6), np.zeros(6)
    both = PERIOD, PERIOD
    for _ in range(2000):
        found = jerk.followed(q, speed, turning, limits.upper + 1.0, robot.speed, both)
        q, speed, turning = q + PERIOD * found, found, (found - speed) / PERIOD
        assert (q <= limits.upper + 1e-12).all()
    assert (limits.upper - q < np.deg2rad(2.0)).all()
