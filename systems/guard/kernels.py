"""What the guard decides in every tick, compiled by numba; a guard imports this module when it is made."""

import math

import numpy as np

from robots.kinematics.kernels import compiled


@compiled
def excess(correction, angle_limit, limit):
    """A correction (6,) as a share of its limits in rad and m, if it has come there; else 0."""
    turn = correction[0] ** 2 + correction[1] ** 2 + correction[2] ** 2
    shift = correction[3] ** 2 + correction[4] ** 2 + correction[5] ** 2
    if turn > angle_limit**2 or shift > limit**2:
        share = max(turn / angle_limit**2, shift / limit**2)
        return math.sqrt(share) if math.isfinite(share) else math.inf
    return 0.0


@compiled
def is_allowed(rows, goal, rate, start, before, velocity):
    """Whether a command may be followed as it is.

    Args:
        rows: of `systems.guard.joint_limits.JointLimits.rows`, (6, 6).
        goal, rate: the command, (6,) each in rad and rad/s.
        start: from where it is a step, (6,) rad.
        before: from where the step before that was, (6,) rad.
        velocity: of the last command, (6,) rad/s.
    """
    for i in range(6):
        lower, upper, top = rows[i, 0], rows[i, 1], rows[i, 2]
        stride, change, bend = rows[i, 3], rows[i, 4], rows[i, 5]
        step = goal[i] - start[i]
        if not (
            lower <= goal[i] <= upper
            and abs(rate[i]) <= top
            and abs(step) <= stride
            and abs(rate[i] - velocity[i]) <= change
            and abs(step - start[i] + before[i]) <= bend
        ):
            return False
        # What is left of the range must suffice for braking.
        if abs(step) > bend:
            room = upper - goal[i] if step > 0.0 else goal[i] - lower
            if abs(step) * (abs(step) - bend) + 0.25 * bend * bend > 2.0 * bend * room:
                return False
    return True


@compiled
def is_command(position, velocity, absurd):
    """Whether the sum of all magnitudes, (6,) each, is a number below an absurd one."""
    total = 0.0
    for i in range(6):
        total += abs(position[i]) + abs(velocity[i])
    return total < absurd


@compiled
def may_be_sent(rows, position, velocity, mean, speed, last, passed, span, slack):
    """Whether a message may be sent as it is.

    Args:
        rows: of each joint lower and upper limit, speed and acceleration, (6, 4).
        position, velocity: in the message, (6,) each in rad and rad/s.
        mean: speeds since the last message, (6,) rad/s.
        speed: mean speeds before it, (6,) rad/s.
        last: velocity in the last message, (6,) rad/s.
        passed, span: s, since the last message, and from the middle of the time before it to that since.
        slack: by how many times a speed may be larger, because it rounds.
    """
    for i in range(6):
        lower, upper, top, most = rows[i, 0], rows[i, 1], slack * rows[i, 2], rows[i, 3]
        if not (
            lower <= position[i] <= upper
            and abs(velocity[i]) <= top
            and abs(mean[i]) <= top
            and abs(velocity[i] - last[i]) <= passed * most
            and abs(mean[i] - speed[i]) <= span * most
        ):
            return False
    return True


def warm_up() -> None:
    """Calls everything once with arrays as a tick has them, so that no tick waits for a compiler."""
    six = np.zeros(6)
    excess(six, 1.0, 1.0)
    is_command(six, six, 1.0)
    is_allowed(np.zeros((6, 6)), six, six, six, six, six)
    may_be_sent(np.zeros((6, 4)), six, six, six, six, six, 1.0, 1.0, 1.0)
