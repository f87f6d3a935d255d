"""The way from where a robot is back to a command that moves: a polynomial of fifth degree in time."""

import math

import numpy as np

from systems.guard.joint_limits import JointLimits

_SPEED, _ACCELERATION, _JERK = 0.25, 0.5, 0.5  # shares of what a joint may do that the way back may add
# Largest slope and bend of the polynomials of `way_left` against those of a straight line.
_STEEPEST, _BEND, _RATE_BEND = 1.875, 10.0 / math.sqrt(3.0), 3.94
_KINK, _RATE_KINK = 60.0, 36.0  # largest third derivatives


def shortest_way(limits: JointLimits, offset: np.ndarray, rate: np.ndarray) -> float:
    """The shortest time in s that the way back may take.

    Args:
        limits: of the joints.
        offset: from the command to the robot, (6,) rad.
        rate: of the offset, (6,) rad/s.
    """
    speed, acceleration = _SPEED * limits.speed, _ACCELERATION * limits.acceleration
    slope = _STEEPEST * np.abs(offset) / speed
    bend = np.sqrt(_BEND * np.abs(offset) / acceleration)
    kink = np.cbrt(_KINK * np.abs(offset) / (_JERK * limits.jerk))
    rate_kink = np.sqrt(_RATE_KINK * np.abs(rate) / (_JERK * limits.jerk))
    return float(np.max([kink, rate_kink, slope, bend, _RATE_BEND * np.abs(rate) / acceleration]))


def way_left(done: float, way: float, offset: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is left of an offset and its rate, (6,) each, when a share of the way is done.

    Args:
        done: the share, 0 to 1.
        way: how long it takes, s.
        offset: at its beginning, (6,) rad.
        rate: at its beginning, (6,) rad/s.
    """
    s = done
    left = 1.0 - s**3 * (10.0 - s * (15.0 - 6.0 * s))
    drift = way * s * (1.0 - s**2 * (6.0 - s * (8.0 - 3.0 * s)))
    left_rate = -30.0 * (s * (1.0 - s)) ** 2 / way
    drift_rate = 1.0 - s**2 * (18.0 - s * (32.0 - 15.0 * s))
    return left * offset + drift * rate, left_rate * offset + drift_rate * rate
