"""Commands of drives, so that motors move as planned whatever the drives leave."""

import math

import numpy as np

from robots.compiled import compiled, inner
from systems.estimation.kernels import drive_columns as at
from systems.estimation.kernels.drives.regression import (
    SHARP_WIDTH,
    THIRD_WIDTH,
    behind,
    filter_errors,
)
from systems.estimation.kernels.geometry import place_links
from systems.estimation.kernels.loads import hold
from systems.estimation.kernels.plan import follow

_WINDS = 0.5  # s, longer at rest than that, steps of an encoder may be taken for it
_MOST_PERIODS = 1.5  # by which torques are sent ahead or held back
# Of the believed Coulomb friction, what may turn over sharply: all of it, a fifth more than believed, and a
# hump. What is learnt first, of motors that hang, may be some times as much, and would push them to and fro.
_MOST_SHARP = 1.5
_HANDED_OVER = 0.3  # s, in which torques take over what positions have made up for
WAITING = 1e-3  # the share with which that begins, once the motor is seen to stick
# Of Coulomb friction, what turns over sharply where a motor sticks. What is learnt of one that does not may
# stand in for gains that are not as believed, and would be multiplied by how much softer the drive is.
_STICKS = 0.3


@inner
def _unwound(drives, v, a, off, sticks, wound, i):
    """The error that is left of what a drive has wound up while its motor hung, and how fast it changes.

    Args:
        v, a: planned, of this joint.
        off: rad, by which it hangs.
        sticks: the share of its friction that does.
        wound: integral and error that are left, and for how long it has hung, (3, 6); are renewed.
        i: which joint.
    """
    step, most = drives.step[0, i], drives.coulomb[i] / drives.ki[0, i]
    if abs(v) < SHARP_WIDTH * drives.width[i] + 0.5 * drives.period * abs(a):
        wound[2, i] = min(wound[2, i] + drives.period, _WINDS)
    elif wound[2, i] > 0.0:
        wound[0, i] += min(max(sticks, 0.0), 1.0) * min(max(off * wound[2, i], -most), most)
        wound[2, i] = 0.0
    integral, e = wound[0, i], wound[1, i]
    wound[0, i] = step[0, 0] * integral + step[0, 1] * e
    wound[1, i] = step[1, 0] * integral + step[1, 1] * e
    return e, -(drives.ki[0, i] * integral + drives.kp[i] * e) / drives.kd[i]


@inner
def _missing(z, beta, i):
    """The following error of a joint by the torques that nobody gives."""
    return z[at.W_MISSING, 1] + z[at.W_NOT_HELD, 1] * beta[at.NOT_HELD + i]


@inner
def _learnt(z, beta, i):
    """The following error of a joint by what has been learnt of its rotor and friction."""
    total = z[at.W_SHARP, 1] * beta[at.SHARP + i] + z[at.W_THIRD, 1] * beta[at.THIRD + i]
    for k in range(at.OF_FRICTION):
        total += z[at.W_ROTOR + k, 1] * beta[at.FRICTION + at.OF_FRICTION * i + k]
    return total


@inner
def _bounded(drives, a, position, speed, is_first, aside, i):
    """What is commanded beside the plan, so that a joint is accelerated no more than it may be.

    Friction that turns over asks for its torque at once, and a soft drive gives it for a large step only.
    Where that were too quick, the command follows as fast as it may, and still comes to rest beside it.

    Args:
        a: planned acceleration of this joint.
        position, speed: rad and rad/s, beside the plan, that are wanted.
        is_first: whether nothing was commanded before.
        aside: (3, 6), of the command before; is renewed.
        i: which joint.

    Returns:
        Position and speed that may be.
    """
    period = drives.period
    change = period * max(drives.acceleration[i] - abs(a), 0.1 * drives.acceleration[i])
    before, mean, last = aside[0, i], aside[1, i], aside[2, i]
    way = (position - before) / period
    if is_first:
        way = speed
        last = speed
    elif abs(way - mean) > change:
        off = position - before - period * speed
        far = abs(off) / (change * period)
        n = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * far) - 1.0))  # as `systems.guard.joint_limits.fastest`
        most = min((n + (far - 0.5 * n * (n + 1.0)) / (n + 1.0)) * change, abs(off) / period)
        way = min(max(speed + math.copysign(most, off), mean - change), mean + change)
        position, speed = before + period * way, way
    speed = min(max(speed, last - change), last + change)
    aside[0, i], aside[1, i], aside[2, i] = position, way, speed
    return position, speed


@inner
def _mean_sign(v, change, width):
    """The mean of tanh(v / width) while the speed changes evenly by so much."""
    begin, end = v / width, (v + change) / width
    if abs(end - begin) < 1e-3:  # right to a ten-millionth, and no difference of nearly equal numbers
        return math.tanh(0.5 * (begin + end))
    return (_log_cosh(end) - _log_cosh(begin)) / (end - begin)


@inner
def _log_cosh(x):
    return abs(x) + math.log1p(math.exp(-2.0 * abs(x)))  # less log 2


@inner
def _possible(led):
    """Parameters of the regression, with no more friction that turns over sharply than there can be."""
    possible = led.copy()
    for i in range(6):
        sharp = min(led[at.SHARP + i], _MOST_SHARP)
        possible[at.SHARP + i], possible[at.THIRD + i] = sharp, min(led[at.THIRD + i], _MOST_SHARP - sharp)
    return possible


@inner
def _taken_over(memory, led, period, i):
    """The share that torques make up for of what was learnt of a joint; it grows once its motor sticks."""
    share = memory.by_torque[0, i]
    if share == 0.0 or (share <= WAITING and led[at.SHARP + i] + led[at.THIRD + i] < _STICKS):
        return 0.0
    memory.by_torque[0, i] = min(1.0, share + period / _HANDED_OVER)
    return share


@inner
def _turning(drives, led, v, turn, turned, i):
    """The torque of one joint that Coulomb friction needs unlike belief, as it was learnt.

    Args:
        led: (75,), parameters of the regression.
        v, turn: in the middle of a period, and by how much it changes in it, rad/s.
        turned: the mean of what is believed over this period, N m.
        i: which joint.
    """
    coulomb, width, f = drives.coulomb[i], drives.width[i], at.FRICTION + at.OF_FRICTION * i
    at_once = coulomb * _mean_sign(v, turn, SHARP_WIDTH * width) - turned
    within = coulomb * _mean_sign(v, turn, THIRD_WIDTH * width) - turned
    scaled = (led[f + 2] + led[f + 3] * math.exp(-abs(v) / drives.slow)) * turned
    return scaled + led[at.SHARP + i] * at_once + led[at.THIRD + i] * within


@compiled
def command(drives, arm, masses, memory, motion, loads, mass, limits, out, rows):
    """What to command so that motors move as planned, see `DriveModel.command`.

    Args:
        drives: `Drives`.
        arm, masses: with which the drives hold it, `Constants` and `Masses`.
        memory: `DriveMemory`; is renewed.
        motion: position, velocity and acceleration of the motors, (6,) each.
        loads: of the gears as motors feel them, (5, 6) or wider.
        mass: of the payload, kg.
        limits: the frequency in rad/s with which commands follow what was learnt, and what the correction
            may add to the speed of a joint in rad/s.
        out: (4, 6), position, velocity, torque, and what of the position is beside the plan because of what
            was learnt; is written.
        rows: of the regressors, (17, 6), in the order of `drive_columns`; are written.
    """
    theta, v, a = motion
    X_WE, frames, w = np.empty((4, 4)), np.empty((7, 4, 4)), np.empty(at.NUM_TORQUES)
    held, with_more = np.empty(6), np.empty(6)
    place_links(arm, theta, X_WE, frames)
    hold(masses, drives.payload, frames, theta, held)
    hold(masses, drives.payload + 1.0, frames, theta, with_more)
    fading = math.exp(-drives.following * drives.period)
    is_first, most = memory.started[0] == 0.0, drives.period * limits[1]
    led, rate = memory.led
    if is_first:
        for k in range(len(led)):
            led[k], rate[k] = memory.beta[k], 0.0
    follow(memory.beta, limits[0], drives.period, led, rate)
    led = _possible(led)
    # Periods that a torque has to be sent ahead: it arrives late by what was learnt, and is held for a period
    # in whose middle it should be right. A dead time that is wrong by more is corrected by the plan.
    late = drives.period * min(max(led[at.DEAD_TIME] / drives.period, -_MOST_PERIODS), _MOST_PERIODS)
    ahead = 0.5 + late / drives.period
    for i in range(6):
        w[at.W_ROTOR], w[at.W_VISCOUS] = drives.rotor[i] * a[i], drives.viscous[i] * v[i]
        # Torques change evenly from one instant to the next: so does the mean of the period about each.
        turn = drives.period * a[i]
        coulomb = drives.coulomb[i] * _mean_sign(v[i] - 0.5 * turn, turn, drives.width[i])
        w[at.W_COULOMB], w[at.W_HUMP] = coulomb, coulomb * math.exp(-abs(v[i]) / drives.slow)
        for k, width in enumerate((SHARP_WIDTH * drives.width[i], THIRD_WIDTH * drives.width[i])):
            w[at.W_SHARP + k] = drives.coulomb[i] * _mean_sign(v[i] - 0.5 * turn, turn, width) - coulomb
        for k in range(4):
            w[at.W_LOADS + k] = loads[1 + k, i]
        w[at.W_NOT_HELD] = with_more[i] - held[i]
        own = w[at.W_ROTOR] + w[at.W_VISCOUS] + coulomb
        w[at.W_MISSING] = needed = own + loads[0, i] + mass * loads[1, i] - held[i]
        z, last = memory.z[0, :, i], memory.w[:, i]
        rows[at.ROW_RATE, i] = 0.0
        out[0, i], out[1, i], out[2, i] = theta[i], v[i], 0.0
        even = needed - coulomb  # what changes evenly
        share = _taken_over(memory, led, drives.period, i)
        if drives.takes_torque:
            turned = drives.coulomb[i] * _mean_sign(v[i] + late * a[i], turn, drives.width[i])
            out[2, i] = needed if is_first else even + ahead * (even - last[at.W_MISSING]) + turned
            f = at.FRICTION + at.OF_FRICTION * i
            known = led[f] * w[at.W_ROTOR] + led[f + 1] * w[at.W_VISCOUS]
            if share > 0.0:
                learnt = known + ahead * (known - memory.by_torque[2, i])
                out[2, i] += share * (learnt + _turning(drives, led, v[i] + late * a[i], turn, turned, i))
            memory.by_torque[2, i] = known
            last[at.W_MISSING] = w[at.W_MISSING] = 0.0  # nothing is missing
        if is_first:
            for gains in range(4):
                for k in range(len(w)):
                    memory.z[gains, k, i, 0] = w[k] / drives.ki[gains, i]
        else:
            filter_errors(drives.step[0, i], z, last, w)
            for gains in range(1, 4):
                filter_errors(drives.step[gains, i], memory.z[gains, :, i], last, w)
        if not drives.takes_torque:
            integral, e = z[at.W_MISSING, 0], z[at.W_MISSING, 1]
            rate = (needed - drives.kp[i] * e - drives.ki[0, i] * integral) / drives.kd[i]
            rows[at.ROW_RATE, i] = rate
            out[0, i] += e
            out[1, i] += rate
        last[at.W_MISSING] = even if drives.takes_torque else needed
        for k in range(at.W_ROTOR, at.NUM_TORQUES):
            last[k] = w[k]
        for k in range(at.W_ROTOR, at.W_SHARP):
            rows[at.ROW_FRICTION + k - at.W_ROTOR, i] = z[k, 1]
        rows[at.ROW_SHARP, i], rows[at.ROW_THIRD, i] = z[at.W_SHARP, 1], z[at.W_THIRD, 1]
        rows[at.ROW_GIVING, i] = missing = _missing(z, led, i)
        for k in range(3):
            other = memory.z[1 + k, :, i]
            rows[at.ROW_OTHER_GAINS + k, i] = _missing(other, led, i) - missing
            if drives.takes_torque:
                rows[at.ROW_OTHER_GAINS + k, i] += (1.0 - share) * (
                    _learnt(other, led, i) - _learnt(z, led, i)
                )
        settled = a[i] / drives.following
        memory.smoothed[i] = settled + fading * (memory.smoothed[i] - settled)
        rows[at.ROW_SMOOTHED, i] = memory.smoothed[i]
        correction = behind(v[i], a[i], rows, led, i)
        before = correction if is_first else memory.correction[i]
        correction = before + min(max(correction - before, -most), most)
        memory.correction[i] = correction
        # Nobody tells both shapes apart at a stop, and a motor that creeps does not stay off.
        off, sticks = memory.hung[1, i], led[at.SHARP + i] + led[at.THIRD + i]
        unwound, speed = _unwound(drives, v[i], a[i], off, sticks, memory.wound, i)
        # Of what the motor would be behind by, torques that are sent leave nothing: as if it were commanded.
        out[3, i] = correction + unwound
        sent = share * _learnt(z, led, i)
        change = correction - before - (sent - memory.by_torque[1, i])
        memory.by_torque[1, i] = sent
        out[0, i] += out[3, i] - sent
        out[1, i] += change / drives.period + speed
        wanted = out[0, i] - theta[i], out[1, i] - v[i]
        position, speed = _bounded(drives, a[i], *wanted, is_first, memory.aside, i)
        if position != wanted[0] or speed != wanted[1]:
            out[3, i] += position - wanted[0]
            out[0, i], out[1, i] = theta[i] + position, v[i] + speed
    memory.started[0] = 1.0
