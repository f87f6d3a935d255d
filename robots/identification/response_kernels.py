"""One case of an elastic arm, step by step with all derivatives, as loops that numba compiles.

`ArmResponse` imports this module when it is made, see `robots.compiled`. The equations and their source stand
there.
"""

import math

import numpy as np

from robots.compiled import compiled
from robots.identification.elastic_parameters import PLAY, RIPPLE
from robots.identification.motion import BETA, GAMMA

_GEARS = 6
_NEWTON_STEPS = 6
_SOLVED = 1e-9  # of the largest acceleration of a gear


@compiled
def gear_step(gear, before, z, turn, rate):
    """What a gear with play and hysteresis carries at the end of a step.

    The same equations as `robots.drivetrain.train.DriveTrains` and `DahlHysteresis`, stepped.

    Args:
        gear: spring in N m / rad, damper in N m s / rad, half of the play in rad, damper within it, spring of
            the hysteresis, width over which it slips in rad; (6,).
        before: deflection at the beginning in rad.
        z: state of the hysteresis then in rad.
        turn, rate: deflection and its rate at the end in rad and rad/s.

    Returns:
        Torque in N m, state of the hysteresis; derivatives of the torque by turn and rate, of the state by
        the one before and by turn; 1 where teeth touch, else 0; torques in N m of spring and damper, of the
        damper where they touch, and of the lubricant.
    """
    spring, damper, half_gap, oil, held, width = gear
    beyond = turn - min(max(turn, -half_gap), half_gap)
    elastic = spring * beyond + damper * rate
    # Without a gap nothing parts.
    out = 1.0 if half_gap <= 0.0 or elastic * beyond > 0.0 else 0.0
    moved = turn - before
    direction, kept = float(np.sign(moved)), math.exp(-abs(moved) / width)
    end = direction * width
    state = end + (z - end) * kept
    state_by_turn = 1.0 - direction * state / width
    torque = out * elastic + oil * rate + held * state
    by_turn, by_rate = out * spring + held * state_by_turn, out * damper + oil
    damped, oiled = out * damper * rate, oil * rate
    return torque, state, by_turn, by_rate, kept, state_by_turn, out, out * elastic, damped, oiled


@compiled
def _solve_gears(gears, before, z, predicted, offset, free, S, stiff, a, h, found):
    """Solves for the accelerations of the gears, `a` (6,), and puts into `found` (6, 10) what these carry.

    Args:
        gears: (6, 6), see `gear_step`.
        before, z: (6,) at the beginning.
        predicted, offset: turn and rate of springs, and of ripple, (2, 6).
        free: accelerations in rad/s^2 were the gears linear, (6,).
        S: what torques on gears accelerate, (e, e).
        stiff: springs and dampers of linear gears, (2, 6).
    """
    lacking, slope, J = np.empty(_GEARS), np.empty(_GEARS), np.empty((_GEARS, _GEARS))
    extra = np.empty(_GEARS)
    for _ in range(_NEWTON_STEPS):
        for j in range(_GEARS):
            turn = predicted[0, j] + BETA * h * h * a[j]
            rate = predicted[1, j] + GAMMA * h * a[j]
            step = gear_step(gears[j], before[j], z[j], turn - offset[0, j], rate - offset[1, j])
            for i in range(10):
                found[j, i] = step[i]
            extra[j] = step[0] - stiff[0, j] * turn - stiff[1, j] * rate
            slope[j] = (step[2] - stiff[0, j]) * (BETA * h * h) + (step[3] - stiff[1, j]) * (GAMMA * h)
        worst, largest = 0.0, 1.0
        for i in range(_GEARS):
            lacking[i] = a[i] - free[i]
            for j in range(_GEARS):
                lacking[i] += S[i, j] * extra[j]
                J[i, j] = S[i, j] * slope[j]
            J[i, i] += 1.0
            worst, largest = max(worst, abs(lacking[i])), max(largest, abs(a[i]))
        if worst < _SOLVED * largest:
            break
        a -= np.linalg.solve(J, lacking)


@compiled
def accelerate(a, free, S, gears, turn, z, ripple, springs, x_p, v_p, h, found):
    """Puts accelerations into `a` (e,), whose first six were those before, and what gears carry into `found`.

    Args:
        free: accelerations in rad/s^2 were the gears linear, (e,).
        S: what torques accelerate, (e, e).
        gears, turn, z, ripple, found: of the gears, see `_solve_gears`.
        springs: springs and dampers, linear, (2, e).
        x_p, v_p: deflections and their rates at the end of the step without these accelerations, (e,).
        h: step in s.
    """
    predicted, of_gears = np.empty((2, _GEARS)), a[:_GEARS].copy()
    predicted[0], predicted[1] = x_p[:_GEARS], v_p[:_GEARS]
    _solve_gears(gears, turn, z, predicted, ripple, free[:_GEARS], S, springs, of_gears, h, found)
    a[:] = free
    for j in range(_GEARS):
        x_j, v_j = x_p[j] + BETA * h * h * of_gears[j], v_p[j] + GAMMA * h * of_gears[j]
        extra = found[j, 0] - springs[0, j] * x_j - springs[1, j] * v_j
        for i in range(len(a)):
            a[i] -= S[i, j] * extra


@compiled
def advance(state, S, motion, rest, torques, turn, z, h, found):
    """One step of an arm by the trapezoidal rule, in place; what gears carry at its end comes into `found`.

    Args:
        state: deflections, their rates and accelerations, (e,) each.
        S: what torques accelerate, (e, e).
        motion: stiffness and Coriolis terms of the motion, (e, 2 e).
        rest: turns at rest, (e,).
        torques: what gives them: load in N m, (e,), ripple, linear springs and gears, see `accelerate`.
        turn, z, found: of the gears, see `_solve_gears`.
        h: step in s.
    """
    x, v, a = state
    load, ripple, springs, gears = torques
    e = len(x)
    place = np.empty(2 * e)
    for j in range(e):
        place[j] = x[j] + h * v[j] + (0.5 - BETA) * h * h * a[j]
        place[e + j] = v[j] + (1.0 - GAMMA) * h * a[j]
    x_p, v_p = place[:e].copy(), place[e:].copy()
    place[:e] -= rest
    free = np.dot(S, -load - springs[0] * x_p - springs[1] * v_p - np.dot(motion, place))
    accelerate(a, free, S, gears, turn, z, ripple, springs, x_p, v_p, h, found)
    for j in range(e):
        x[j], v[j] = x_p[j] + BETA * h * h * a[j], v_p[j] + GAMMA * h * a[j]


@compiled
def _subtract_explicit(rhs, gears, found, carried, columns, by, z, state):
    """Takes d(springs, dampers) / d(unknowns), with the motion as it is, from `rhs` (e, n).

    Args:
        rhs: is changed.
        gears, found: see `_solve_gears`.
        carried: springs and dampers in N m, (2, e).
        columns: of the unknowns, see `go_through`.
        by: derivatives of turn and hysteresis of the gears at the beginning, (2, 6, n).
        z: hysteresis at the beginning, (6,).
        state: d(hysteresis) / d(unknowns) but for what the deflection at the end does, (6, n); written.
    """
    of_joint, of_gear, lubricant, width = columns
    for j in range(rhs.shape[0]):
        gear = j < _GEARS
        rhs[j, of_joint[0, j]] -= found[j, 0] if gear else carried[0, j]
        rhs[j, of_joint[1, j]] -= found[j, 8] + found[j, 9] if gear else carried[1, j]
    if lubricant < 0:
        return
    for j in range(_GEARS):
        spring, held, slips = gears[j, 0], gears[j, 4], gears[j, 5]
        kept, by_turn = found[j, 4], found[j, 5]
        for u in range(rhs.shape[1]):
            state[j, u] = kept * by[1, j, u] - by_turn * by[0, j, u]
        moved = -slips * math.log(max(kept, 1e-300))
        direction = float(np.sign(found[j, 1] - z[j]))
        state[j, width] += (
            slips * direction * (1.0 - kept) + (z[j] - direction * slips) * kept * moved / slips
        )
        rhs[j, of_gear[0, j]] += 0.5 * PLAY * spring * found[j, 6] * np.sign(found[j, 7])
        rhs[j, lubricant] -= found[j, 9]
        rhs[j, of_gear[1, j]] -= spring * found[j, 1]
        for u in range(rhs.shape[1]):
            rhs[j, u] -= held * state[j, u]


@compiled
def place_of(at, knot, step):
    """The last knot before a step, sought from `knot` on, and the share of the way to the next one."""
    while knot < len(at) - 2 and step >= at[knot + 1]:
        knot += 1
    return knot, min((step - at[knot]) / (at[knot + 1] - at[knot]), 1.0)


@compiled
def between(values, knot, share, out):
    """Between a knot and the next one, (k, rows, columns) into (rows, columns)."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = (1.0 - share) * values[knot, i, j] + share * values[knot + 1, i, j]


@compiled
def _next_sensitivity(Y, by, S, motion, gears, found, stiff, carried, columns, waves, z, h):
    """Derivatives of the state by the unknowns, from the beginning of a step to its end, in place.

    Args:
        Y: of deflections, their rates and accelerations, (3 e, n).
        by: of turn and hysteresis of the gears, (2, 6, n).
        S: what torques accelerate, (e, e).
        motion: stiffness and Coriolis terms of the motion, (e, 2 e).
        gears, found: see `_solve_gears`.
        stiff: springs and dampers, linear, (2, e).
        carried: what these carry in N m, (2, e).
        columns: see `go_through`.
        waves: a unit of ripple and its rate, (2, 2, 6).
        z: hysteresis at the beginning, (6,).
        h: step in s.
    """
    e, n = len(S), Y.shape[1]
    of_gear = columns[1]
    P = np.empty((2 * e, n))
    for j in range(e):
        for u in range(n):
            x, v, a = Y[j, u], Y[e + j, u], Y[2 * e + j, u]
            P[j, u] = x + h * v + (0.5 - BETA) * h * h * a
            P[e + j, u] = v + (1.0 - GAMMA) * h * a
    whole = -motion
    for j in range(e):
        gear = j < _GEARS
        whole[j, j] -= found[j, 2] if gear else stiff[0, j]
        whole[j, e + j] -= found[j, 3] if gear else stiff[1, j]
    rhs = np.dot(whole, P)
    state = np.zeros((_GEARS, n))
    _subtract_explicit(rhs, gears, found, carried, columns, by, z, state)
    for j in range(_GEARS):
        for part in range(2):
            column = of_gear[2 + part, j]
            if column >= 0:
                turned = found[j, 2] * waves[0, part, j] + found[j, 3] * waves[1, part, j]
                rhs[j, column] += RIPPLE * turned
    a = np.dot(S, rhs)
    slope, J = np.empty(_GEARS), np.eye(_GEARS)
    for j in range(_GEARS):
        beyond = (found[j, 2] - stiff[0, j]) * (BETA * h * h) + (found[j, 3] - stiff[1, j]) * (GAMMA * h)
        slope[j] = beyond
        for i in range(_GEARS):
            J[i, j] += S[i, j] * beyond
    of_gears = np.linalg.solve(J, a[:_GEARS])
    for j in range(_GEARS):
        of_gears[j] *= slope[j]
    a -= np.dot(np.ascontiguousarray(S[:, :_GEARS]), of_gears)
    for j in range(e):
        for u in range(n):
            Y[j, u] = P[j, u] + BETA * h * h * a[j, u]
            Y[e + j, u] = P[e + j, u] + GAMMA * h * a[j, u]
            Y[2 * e + j, u] = a[j, u]
    for j in range(_GEARS):
        by[0, j] = Y[j]
        for part in range(2):
            column = of_gear[2 + part, j]
            if column >= 0:
                by[0, j, column] -= RIPPLE * waves[0, part, j]
        for u in range(n):
            by[1, j, u] = found[j, 5] * by[0, j, u] + state[j, u]


@compiled
def _low_pass(new, old, now, before, values):
    """One sample of a low-pass of first order per row, in place; `before` is what came in last, (c, n)."""
    for i in range(values.shape[0]):
        for u in range(values.shape[1]):
            values[i, u] = old[i] * values[i, u] + new[i] * (now[i, u] + before[i, u])
            before[i, u] = now[i, u]


@compiled
def go_through(steps, posture, course, springs, gears, columns, start, low_pass, moved, shown, derived):
    """Goes through one case; e sprung joints, c channels, k knots, N steps, n unknowns (0: no derivatives).

    Args:
        steps: length of a step in s, and how many there are from reading to reading, from one that is kept
            to the next, and in a sample of the case.
        posture: what changes with it, at knots: the steps at which they are, (k,); stiffness and Coriolis
            terms of the motion, (k, e, 2 e); turns at rest, (k, 1, e); derivatives of the readings by turn,
            speed and acceleration, (k, c, 3 e); and closer to one another, the inverse of mass, damping and
            stiffness of a step: at which steps, (f,), and values, (f, e, e).
        course: what changes faster: load in N m, (N, e); ripple of the gears and its rate in rad and rad/s,
            (N, 2, 6); a unit of sine and cosine of it, and their rates, (N, 2, 2, 6).
        springs: springs and dampers, linear, (2, e).
        gears: (6, 6), see `gear_step`.
        columns: of the unknowns: springs and retardation times of the joints, (2, e); play, hysteresis, sine
            and cosine of the gears' ripple, (4, 6), -1 for none; lubricant, -1 for none; width.
        start: deflections, (e,), and their derivatives with those of the gears' turns, (e + 6, n).
        low_pass: factors of the sensors, what is new and what stays, (2, c).
        moved: deflections, their rates and accelerations at the samples, (samples, 3 e); written.
        shown, derived: what yielding adds to kept readings, (m, c), and derivatives, (m, c, n); written.
    """
    h, every, kept, in_sample = steps
    at, motion, rest, levers, close, inverse = posture
    load, ripple, waves = course
    e, n = springs.shape[1], derived.shape[2]
    x, v, a = start[0].copy(), np.zeros(e), np.zeros(e)
    turn, z = x[:_GEARS] - ripple[0, 0], np.zeros(_GEARS)
    Y, by = np.zeros((3 * e, n)), np.zeros((2, _GEARS, n))
    Y[:e], by[0] = start[1][:e], start[1][e:]
    S, motion_now, rest_now = np.empty((e, e)), np.empty((e, 2 * e)), np.empty((1, e))
    channels = shown.shape[1]
    levers_now = np.empty((channels, 3 * e))
    found, carried = np.zeros((_GEARS, 10)), np.empty((2, e))
    reading, last = np.empty((channels, 1)), np.empty((channels, 1))
    derivative, last_derivative = np.empty((channels, n)), np.empty((channels, n))
    knot, last_close = 0, 0
    for step in range(len(load)):
        knot, share = place_of(at, knot, step)
        between(rest, knot, share, rest_now)
        if step:
            last_close, gone = place_of(close, last_close, step)
            between(inverse, last_close, gone, S)
            between(motion, knot, share, motion_now)
            state, torques = (x, v, a), (load[step], ripple[step], springs, gears)
            advance(state, S, motion_now, rest_now[0], torques, turn, z, h, found)
            for j in range(e):
                carried[0, j], carried[1, j] = springs[0, j] * x[j], springs[1, j] * v[j]
            if n:
                _next_sensitivity(
                    Y, by, S, motion_now, gears, found, springs, carried, columns, waves[step], z, h
                )
            for j in range(_GEARS):
                turn[j], z[j] = x[j] - ripple[step, 0, j], found[j, 1]
        if step % in_sample == 0:
            now_at = moved[step // in_sample]
            now_at[:e], now_at[e : 2 * e], now_at[2 * e :] = x, v, a
        if step % every:
            continue
        between(levers, knot, share, levers_now)
        yielded = np.concatenate((x - rest_now[0], v, a))
        now = np.dot(levers_now, yielded).reshape(channels, 1)
        now_derived = np.dot(levers_now, Y)
        if step == 0:  # at rest for long
            reading[:], last[:] = now, now
            derivative[:], last_derivative[:] = now_derived, now_derived
        else:
            _low_pass(low_pass[0], low_pass[1], now, last, reading)
            _low_pass(low_pass[0], low_pass[1], now_derived, last_derivative, derivative)
        if step % kept == 0:
            shown[step // kept] = reading[:, 0]
            derived[step // kept] = derivative
