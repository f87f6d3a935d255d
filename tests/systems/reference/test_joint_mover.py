"""The joint mover: rest at both ends, no joint too fast, position and velocity of one motion."""

import numpy as np
import pytest

from systems.reference.joint_mover import JointMover

SPEED = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
GOAL = np.array([1.0, -0.5, 0.2, 3.0, 0.0, -2.0])


def moving() -> tuple[JointMover, np.ndarray, np.ndarray, np.ndarray]:
    """Times from the start to after the end of a motion from zero, with positions and velocities."""
    mover = JointMover(SPEED)
    context = mover.CreateDefaultContext()
    mover.set_at_rest(context, np.zeros(6))
    times = np.linspace(0.0, mover.go(context, GOAL) + 0.1, 2000)
    positions, velocities = [], []
    for time in times:
        context.SetTime(time)
        positions.append(mover.GetOutputPort("position_command").Eval(context))
        velocities.append(mover.GetOutputPort("velocity_command").Eval(context))
    return mover, times, np.array(positions), np.array(velocities)


def test_it_goes_to_its_goal_and_stays_without_breaking_a_limit():
    _, times, q, v = moving()
    np.testing.assert_allclose(q[[0, -1]], [np.zeros(6), GOAL], atol=1e-12)
    assert np.abs(v[[0, -1]]).max() == 0.0
    assert (np.abs(v) <= SPEED + 1e-9).all()
    assert np.abs(v[:, 0]).max() == pytest.approx(SPEED[0], rel=1e-3)  # the joint that needs longest
    np.testing.assert_allclose(np.gradient(q, times, axis=0)[1:-1], v[1:-1], atol=2e-5)


def test_a_new_goal_starts_where_the_joints_are():
    mover = JointMover(SPEED)
    context = mover.CreateDefaultContext()
    mover.set_at_rest(context, GOAL)
    mover.go(context, np.zeros(6))
    np.testing.assert_allclose(mover.GetOutputPort("position_command").Eval(context), GOAL)


def test_a_joint_without_speed_is_refused():
    with pytest.raises(ValueError, match="speeds and duration must be positive"):
        JointMover(np.zeros(6))


def test_it_stands_still_until_it_is_told_to_go():
    mover = JointMover(np.ones(6))
    context = mover.CreateDefaultContext()
    for time in (0.0, 0.1, 5.0):
        context.SetTime(time)
        for name in ("position_command", "velocity_command"):
            assert not mover.GetOutputPort(name).Eval(context).any()
