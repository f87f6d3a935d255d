"""A robot that does not follow its commands is told from one that follows late, badly or not quite there."""

import numpy as np
import pytest

from systems.guard.following import Following

PERIOD = 4e-3  # s
TIMES = PERIOD * np.arange(1500)


def told(joints: np.ndarray, commands: np.ndarray, is_speed_only: bool = False) -> str:
    """What is said after joints and their commands in rad, (n, 6) each."""
    following = Following(is_speed_only)
    for measured, command, velocity in zip(
        joints, commands, np.gradient(commands, PERIOD, axis=0), strict=True
    ):
        position = measured if is_speed_only else command
        following.note(measured, position, velocity, PERIOD)
        if following.problem:
            break
    return following.problem


def motion(amplitude_deg: float, times: np.ndarray = TIMES) -> np.ndarray:
    """All joints back and forth every two seconds, rad."""
    swing = np.deg2rad(amplitude_deg) * (1.0 - np.cos(np.pi * np.maximum(times, 0.0)))
    return np.tile(swing[:, None], (1, 6))


@pytest.mark.parametrize("is_speed_only", [False, True])
def test_the_joint_that_stands_is_named(is_speed_only: bool):
    commands = motion(5.0)
    joints = commands.copy()
    joints[:, 3] = 1e-5 * np.random.default_rng(0).normal(size=len(TIMES))  # rad, its encoder
    assert "joint 4 stands still" in told(joints, commands, is_speed_only)


def test_who_follows_late_less_and_elsewhere_follows():
    late = 0.8 * motion(5.0, TIMES - 0.3) + 0.02  # rad
    assert told(late, motion(5.0)) == ""


def test_who_is_sent_nowhere_need_not_move():
    """Noise of a camera moves commands a little, too."""
    noise = 1e-3 * np.random.default_rng(0).normal(size=(len(TIMES), 6))  # rad
    assert told(np.zeros((len(TIMES), 6)), noise) == ""


def test_where_commands_begin_anew_what_was_before_does_not_count():
    following, zero = Following(False), np.zeros(6)
    for number in range(len(TIMES)):
        if number % 100 == 0:
            following.restart()
        following.note(zero, np.full(6, 0.1 * (number // 100)), zero, PERIOD)
    assert following.problem == ""
