"""What the guard decides in every tick, compiled by numba; a guard imports this module when it is made."""

import math

import numpy as np

from robots.compiled import compiled
from systems.guard import state as at
from systems.guard.config import KINDS

_COUNTED, _JOINTS, _WERE_AT = at.COUNTED.start, at.JOINTS.start, at.WERE_AT.start
_NO_COMMAND, _REFUSED, _HELD = (
    _COUNTED + KINDS.index(kind) for kind in ("no_command", "measurement_refused", "measurement_held")
)


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
        # What is left of the range must suffice for braking: `systems.guard.joint_limits.stoppable`.
        room = upper - position[i] if mean[i] > 0.0 else position[i] - lower
        if abs(mean[i]) > slack * (0.5 * passed * most + math.sqrt(2.0 * most * room)):
            return False
    return True


@compiled
def note_camera(decision, measurement):
    """Adds to a decision what is counted of the camera, and when its last usable sample arrived."""
    if decision[at.MODE] == at.HOLDING:
        decision[_HELD] = 1.0
    if measurement[1] > decision[at.REFUSED_SEEN]:
        decision[_REFUSED], decision[at.REFUSED_SEEN] = 1.0, measurement[1]
    decision[at.LAST_SAMPLE] = measurement[0]


@compiled
def decided(
    state,
    position,
    velocity,
    correction,
    measurement,
    joints,
    rows,
    angle_limit,
    limit,
    absurd,
    is_speed_only,
    period,
    decision,
):
    """Whether a command may be passed on as it is; then the decision at the end of the arguments says so.

    So it is in almost every tick: the robot runs and has been commanded before, its joints are known, the law
    is followed, gives a command, its correction is within its limits, and the joints can do it. Everything
    else is the guard's to decide.
    """
    mode, known = state[at.MODE], state[0]
    for i in range(6):
        known += joints[i]
    is_followed = (mode == at.GOING or mode == at.HOLDING) and excess(correction, angle_limit, limit) == 0.0
    if not (math.isfinite(known) and is_followed and is_command(position, velocity, absurd)):
        return False
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
    if not is_allowed(rows, position, velocity, start, before, last):
        return False
    for i in range(len(decision)):
        decision[i] = state[i] if i < at.WIDTH else 0.0
    for i in range(6):
        decision[at.LAST_BUT_ONE + i] = state[at.POSITION + i]
        decision[at.POSITION + i] = position[i]
        decision[at.VELOCITY + i] = decision[at.BRAKING + i] = velocity[i]
        decision[_JOINTS + i] = joints[i]
    note_camera(decision, measurement)
    return True


@compiled
def remember(decision, time, uses_camera, hold_after, stop_after, resume, state):
    """Makes a decision the state for the next tick, with the mode that the clocks say.

    Args:
        decision: at this tick.
        time: of this tick in s.
        uses_camera: whether the age of samples matters.
        hold_after, stop_after, resume: of `GuardConfig`.
        state: the one before, which is changed.

    Returns:
        Whether nothing else is to be noted.
    """
    for i in range(at.WIDTH):
        state[i] = decision[i]
    is_usual = state[at.DEVIATES] == 0.0
    for i in range(_COUNTED, at.LAST_SAMPLE):
        is_usual = is_usual and decision[i] == 0.0
    has_no_command = decision[_NO_COMMAND] > 0.0
    if not has_no_command:
        state[at.LAST_COMMAND] = time
    # A camera that has not spoken yet is not lost: its time starts with the guard's first tick.
    state[at.FIRST_TICK] = min(state[at.FIRST_TICK], time)
    age = time - max(decision[at.LAST_SAMPLE], state[at.FIRST_TICK]) if uses_camera else 0.0
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
    if not math.isnan(decision[_JOINTS]):
        for i in range(6):
            state[_WERE_AT + i] = decision[_JOINTS + i]
    return is_usual


def warm_up() -> None:
    """Calls everything once with arrays as a tick has them, so that no tick waits for a compiler."""
    six, three, decision = np.zeros(6), np.zeros(3), np.zeros(at.DECISION_WIDTH)
    state, locked = np.zeros(at.WIDTH), np.zeros(at.WIDTH)
    locked.flags.writeable = False  # as Drake hands out a state sometimes
    for each in (state, locked):
        rows = np.zeros((6, 6))
        decided(each, six, six, six, three, six, rows, 1.0, 1.0, 1.0, False, 1.0, decision)
    remember(decision, 0.0, True, 1.0, 1.0, False, state)
    note_camera(decision, three)
    excess(six, 1.0, 1.0)
    is_command(six, six, 1.0)
    is_allowed(np.zeros((6, 6)), six, six, six, six, six)
    may_be_sent(np.zeros((6, 4)), six, six, six, six, six, 1.0, 1.0, 1.0)
