"""What the guard decides in every tick, compiled by numba; a guard imports this module when it is made."""

import math

import numpy as np

from robots.kinematics.kernels import compiled
from systems.guard import state as at


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


@compiled
def follow(state, position, velocity, correction, rows, angle_limit, limit, absurd, is_speed_only, period):
    """The state after a command that is passed on as it is, and whether it may be.

    So it is in almost every tick: the law is followed, gives a command, its correction is within its limits,
    and the joints can do it. Everything else is the guard's to decide.
    """
    followed = state.copy()
    mode = state[at.MODE]
    is_followed = (mode == at.GOING or mode == at.HOLDING) and excess(correction, angle_limit, limit) == 0.0
    if not (is_followed and is_command(position, velocity, absurd)):
        return followed, False
    start, before, last = np.empty(6), np.empty(6), np.empty(6)
    for i in range(6):
        start[i], before[i], last[i] = (
            state[at.POSITION + i],
            state[at.LAST_BUT_ONE + i],
            state[at.VELOCITY + i],
        )
        if is_speed_only:  # from where the robot is, which what was issued before does not tell
            start[i] = position[i] - period * velocity[i]
            before[i] = start[i] - period * last[i]
        followed[at.LAST_BUT_ONE + i] = state[at.POSITION + i]
        followed[at.POSITION + i] = position[i]
        followed[at.VELOCITY + i] = followed[at.BRAKING + i] = velocity[i]
    return followed, is_allowed(rows, position, velocity, start, before, last)


@compiled
def remembered(state, time, last_sample, uses_camera, has_no_command, hold_after, stop_after, resume):
    """The state for the next tick, a new one, with the mode that the clocks say.

    Args:
        state: what was decided at this tick.
        time: of this tick in s.
        last_sample: when the last usable sample arrived, in s.
        uses_camera: whether the age of samples matters.
        has_no_command: whether the law gave none.
        hold_after, stop_after, resume: of `GuardConfig`.
    """
    state = state.copy()
    if not has_no_command:
        state[at.LAST_COMMAND] = time
    # A camera that has not spoken yet is not lost: its time starts with the guard's first tick.
    state[at.FIRST_TICK] = min(state[at.FIRST_TICK], time)
    age = time - max(last_sample, state[at.FIRST_TICK]) if uses_camera else 0.0
    silence = time - state[at.LAST_COMMAND]
    mode = state[at.MODE]
    if mode == at.STOPPING:
        speed = 0.0
        for i in range(6):
            speed += abs(state[at.VELOCITY + i])
        if resume and max(age, silence) < hold_after and speed == 0.0:
            state[at.MODE] = at.IDLE
    elif max(age, silence) >= stop_after - 1e-9:
        state[at.MODE] = at.STOPPING
    elif has_no_command:
        state[at.MODE] = at.AWAY
    elif mode != at.IDLE and mode != at.RESUMING and mode != at.AWAY:
        state[at.MODE] = at.HOLDING if age >= hold_after - 1e-9 else at.GOING
    return state


def warm_up() -> None:
    """Calls everything once with arrays as a tick has them, so that no tick waits for a compiler."""
    six = np.zeros(6)
    state, locked = np.zeros(at.WIDTH), np.zeros(at.WIDTH)
    locked.flags.writeable = False  # as Drake hands out a state sometimes
    for each in (state, locked):
        follow(each, six, six, six, np.zeros((6, 6)), 1.0, 1.0, 1.0, False, 1.0)
    remembered(state, 0.0, 0.0, True, False, 1.0, 1.0, False)
    excess(six, 1.0, 1.0)
    is_command(six, six, 1.0)
    is_allowed(np.zeros((6, 6)), six, six, six, six, six)
    may_be_sent(np.zeros((6, 4)), six, six, six, six, six, 1.0, 1.0, 1.0)
