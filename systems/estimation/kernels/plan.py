"""Motions of the joints on a path: Newton's method on the estimated arm, and what its loads bend."""

import math

import numpy as np

from robots.compiled import compiled, inner
from systems.estimation.kernels.gears import differ, mix, shapes, springs
from systems.estimation.kernels.gears import step as step_gears
from systems.estimation.kernels.geometry import place
from systems.estimation.kernels.loads import load
from systems.estimation.kernels.poses import error
from systems.estimation.kernels.tip import deflect, move_by_geometry

# s, in which models of gears come to count as much as they are likely, so that no plan jerks
_LED = 0.5
# Of the search for the nearest pose: m for a rad, what damps it in m at first, by which it is damped less,
# and where it ends
_ARM, _DAMPING, _RELAX, _NEAR, _MOST_STEPS = 0.25, 0.01, 3.0, 1e-5, 30


@inner
def invert(columns, inverse):
    """The inverse of the first six columns, by Gauss and Jordan with the largest pivots."""
    n = 6
    work = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            work[i, j] = columns[i, j]
            inverse[i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        for j in range(n):
            work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
            inverse[k, j], inverse[pivot, j] = inverse[pivot, j], inverse[k, j]
        scale = 1.0 / work[k, k]
        for j in range(n):
            work[k, j] *= scale
            inverse[k, j] *= scale
        for i in range(n):
            factor = work[i, k]
            if i != k and factor != 0.0:
                for j in range(n):
                    work[i, j] -= factor * work[k, j]
                    inverse[i, j] -= factor * inverse[k, j]


@inner
def _newton(c, x, q, start_error, wanted, frames, columns, inverse):
    """One step towards a pose, in place; the arm is the one before it. Returns its size in rad."""
    X, r, largest = np.empty((4, 4)), np.empty(6), 0.0
    place(c, q, X, frames, columns)
    move_by_geometry(c, x, columns, X, r)
    error(wanted.X_WE, X, r)
    invert(columns, inverse)
    for i in range(6):
        move = 0.0
        for j in range(6):
            move += inverse[i, j] * (r[j] - wanted.left * start_error[j])
        q[i] += move
        largest = max(largest, abs(move))
    return largest


@inner
def _follow(c, masses, unknowns, wanted, state, moving, columns, loads, yields):
    """The joints behind the gears where a stiff arm is on the path, and what motion and load bend there.

    Returns the last step of Newton's method, in rad.

    Args:
        c, masses, unknowns: the arm.
        wanted: `PathInstant`.
        state: `FollowerState`; is renewed.
        moving: (3, 6) rad and derivatives of the joints, with the motion beside the path; columns: (6, C);
            loads: (5, 18); yields: (6,) in rad, by which springs make motors be ahead of links; are written.
    """
    frames, inverse, X = np.empty((7, 4, 4)), np.empty((6, 6)), np.empty((4, 4))
    q, rates, wander, start = state.q, state.rates, state.wander, state.start_error
    for i in range(6):
        q[i] += wanted.step * (1.5 * rates[0, i] - 0.5 * rates[1, i] + wander[i])
    missed = _newton(c, unknowns.x, q, start, wanted, frames, columns, inverse)
    if missed > wanted.newton_step:
        missed = _newton(c, unknowns.x, q, start, wanted, frames, columns, inverse)
    drift = np.empty(6)
    for i in range(6):
        drift[i] = wanted.fading * start[i]
        for k in range(len(c.chosen)):
            drift[i] += columns[i, 18 + k] * wanted.parameter_rate[k]
    is_aside = False
    for i in range(6):
        v = wander[i] = 0.0
        for j in range(6):
            v += inverse[i, j] * wanted.V_WE[j]
            wander[i] -= inverse[i, j] * drift[j]
        moving[0, i] = q[i] + wanted.aside[0, i]
        moving[1, i] = v + wanted.aside[1, i]
        moving[2, i] = (1.5 * v - 2.0 * rates[0, i] + 0.5 * rates[1, i]) / wanted.step + wanted.aside[2, i]
        rates[1, i], rates[0, i] = rates[0, i], v
        is_aside = is_aside or wanted.aside[0, i] != 0.0 or wanted.aside[1, i] != 0.0
    if is_aside:
        place(c, moving[0], X, frames, columns)
        invert(columns, inverse)
    load(masses, frames, moving[0], moving[1], moving[2], loads)
    unit, deflection = np.empty(18), np.empty(18)
    deflect(unknowns, len(c.chosen), loads, unit, deflection)
    for i in range(6):
        yields[i] = -deflection[i]
        for k in range(6):
            tilt = 0.0
            for j in range(6, 18):
                tilt += columns[k, j] * deflection[j]
            yields[i] -= inverse[i, k] * tilt
    return missed


@inner
def _motors(moving, wander, yields, history, step, lag, columns, out):
    """Motion of the motors, (3, 6), and the twist of the tip as the fourth row.

    Args:
        moving: of the joints behind the gears, (3, 6), and ``wander``, (6,), what parameters add to velocity.
        yields: by which motors are ahead, (6,); ``history`` the last four of them, newest first, is renewed.
        step: s since the instant before.
        lag: of the gears, by their damping, s, (6,).
        columns: (6, C).
        out: (4, 6), is written.
    """
    for i in range(6):
        for k in range(3, 0, -1):
            history[k, i] = history[k - 1, i]
        history[0, i] = yields[i]
        y0, y1, y2, y3 = yields[i], history[1, i], history[2, i], history[3, i]
        rate = (11.0 * y0 - 18.0 * y1 + 9.0 * y2 - 2.0 * y3) / (6.0 * step)
        bend = (2.0 * y0 - 5.0 * y1 + 4.0 * y2 - y3) / step**2
        out[0, i] = moving[0, i] + y0 - lag[i] * rate
        out[1, i] = moving[1, i] + wander[i] + rate
        out[2, i] = moving[2, i] + bend
    for k in range(6):
        out[3, k] = 0.0
        for i in range(6):
            out[3, k] += columns[k, i] * (moving[1, i] + wander[i])


@inner
def _add_gear_errors(gears, unknowns, g, wanted, planned, state, yields):
    """By how much gears are off beyond their springs, taken from the yields; renews their state."""
    x, torque, turns = unknowns.x, np.empty(6), np.empty(6)
    for j in range(6):
        torque[j] = planned.loads[0, j]
        for k in range(4):
            torque[j] += x[g + 18 + k] * planned.loads[1 + k, j]
        turns[j] = gears.ratio[j] * (planned.moving[0, j] + yields[j])
    sizes = x[g + 24 :].reshape(-1, 6)
    bend = springs(gears.compliance, gears.gap, x[g : g + 6], sizes)
    step_gears(bend, gears.gap, torque, wanted.step, False, state.gears)
    lead = min(1.0, wanted.step / _LED)
    for m in range(len(state.shares)):
        for j in range(6):
            state.shares[m, j] += lead * (wanted.likely[m, j] - state.shares[m, j])
    mix(gears.gap, state.gears, state.shares, planned.states)
    differ(gears.gap, state.gears, planned.states, sizes, planned.others)
    waves = np.empty(sizes.shape)
    shapes(turns, planned.states, waves)
    for k in range(len(sizes)):
        for j in range(6):
            yields[j] -= waves[k, j] * sizes[k, j]
    for j in range(6):
        once = sizes[0, j] * waves[1, j] - sizes[1, j] * waves[0, j]
        twice = sizes[2, j] * waves[3, j] - sizes[3, j] * waves[2, j]
        planned.ratios[j] = 1.0 + gears.ratio[j] * (once + 2.0 * twice)


@compiled
def plan(c, masses, unknowns, gears, wanted, state, planned):
    """Plans one instant.

    Args:
        c, masses, unknowns, gears: the arm, and the gears that it has errors of, if any.
        wanted: `PathInstant`.
        state: `FollowerState`; is renewed.
        planned: `Planned`; is written.

    Returns:
        The last step of Newton's method, in rad: none to speak of where the arm is on the path.
    """
    yields, g = np.empty(6), len(c.chosen)
    for j in range(6):
        planned.ratios[j] = 1.0
    moving, columns = planned.moving, planned.columns
    missed = _follow(c, masses, unknowns, wanted, state, moving, columns, planned.loads, yields)
    if len(unknowns.x) > g + 24:
        _add_gear_errors(gears, unknowns, g, wanted, planned, state, yields)
    for i in range(6):
        yields[i] += wanted.left * state.start_yield[i]
    history = state.yields
    _motors(moving, state.wander, yields, history, wanted.step, gears.lag, columns, planned.motion)
    return missed


@inner
def _apart(c, x, X_WE, q, frames, columns, r):
    """How far the tip is from a pose, in m; renews the columns and the error ``r``, both in m."""
    X, square = np.empty((4, 4)), 0.0
    place(c, q, X, frames, columns)
    move_by_geometry(c, x, columns, X, r)
    error(X_WE, X, r)
    for i in range(6):
        arm = _ARM if i < 3 else 1.0
        r[i] *= arm
        square += r[i] * r[i]
        for j in range(6):
            columns[i, j] *= arm
    return math.sqrt(square)


@compiled
def missing(c, x, X_WE, q):
    """How far the tip stays from a pose at best, in m, turns counted at an arm of 0.25 m.

    By Levenberg and Marquardt: what comes no nearer is damped more, so a stretched arm is not thrown about as
    by Newton's method.

    Args:
        c, x: the arm, without its loads.
        X_WE: the pose, (4, 4).
        q: near to it, rad, (6,); is renewed.
    """
    frames, columns, r = np.empty((7, 4, 4)), np.empty((6, len(c.frame))), np.empty(6)
    normal, inverse, slope, tried = np.empty((6, 6)), np.empty((6, 6)), np.empty(6), np.empty(6)
    left, damping = _apart(c, x, X_WE, q, frames, columns, r), _DAMPING
    for _ in range(_MOST_STEPS):
        if left < _NEAR:
            break
        for i in range(6):
            slope[i] = 0.0
            for k in range(6):
                slope[i] += columns[k, i] * r[k]
            for j in range(6):
                normal[i, j] = damping * damping if i == j else 0.0
                for k in range(6):
                    normal[i, j] += columns[k, i] * columns[k, j]
        invert(normal, inverse)
        for i in range(6):
            tried[i] = q[i]
            for j in range(6):
                tried[i] += inverse[i, j] * slope[j]
        now = _apart(c, x, X_WE, tried, frames, columns, r)
        if now < left:
            q[:], left, damping = tried, now, damping / _RELAX
        else:
            damping *= _RELAX * _RELAX
            _apart(c, x, X_WE, q, frames, columns, r)
    return left


@inner
def follow(target, frequency, period, x, rate):
    """A step of values and their rates towards a target, critically damped, (n,) each, in place."""
    w = frequency * period
    slowing = 1.0 + w * (2.0 + w)
    for k in range(len(target)):
        rate[k] = (rate[k] + frequency * w * (target[k] - x[k])) / slowing
        x[k] += period * rate[k]


@compiled
def lead(x, rate, target, columns, limits, arm, period):
    """A step of `ParameterLead`, in place; returns the acceleration of the tip in m/s^2.

    Args:
        x, rate, target: (n,).
        columns: of the tip for the first parameters, (6, g), zero if they are not known yet.
        limits: of frequency in rad/s and acceleration in m/s^2.
        arm: m, by which an angle counts as a way.
        period: s.
    """
    is_known, square = False, 0.0
    for i in range(6):
        effect = 0.0
        for k in range(columns.shape[1]):
            effect += columns[i, k] * (target[k] - x[k])
            is_known = is_known or columns[i, k] != 0.0
        square += effect * effect * (arm * arm if i < 3 else 1.0)
    size = math.sqrt(square) if is_known else 0.05
    w = min(limits[0], math.sqrt(limits[1] / max(size, 1e-9)))
    follow(target, w, period, x, rate)
    return w * w * size
