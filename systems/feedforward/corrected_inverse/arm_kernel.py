"""An elastic arm behind motors that move a little otherwise than planned, step by step, compiled by numba.

numba takes a third of a second to import: `BelievedArm` imports this module when it goes through a motion.
"""

import numpy as np

from robots.compiled import compiled
from robots.identification.motion import BETA, GAMMA
from robots.identification.response_kernels import advance, between, place_of

_GEARS = 6
MOVED = 3  # axes whose motors move otherwise than planned: those that move the tip


@compiled
def go_through(h, posture, load, offset, springs, gears, start, shapes, every, moved, torque, derived):
    """Goes through a motion; e sprung joints, k knots, N steps, c shapes, n = 3 c unknowns (0: none).

    The unknowns are by how much each shape is in the motions of the first three motors: number 3 i + j of
    shape i and motor j.

    Args:
        h: step in s.
        posture: steps at which the knots are, (k,), and there stiffness and Coriolis terms of the motion,
            (k, e, 2 e), turns at rest, (k, 1, e), and d(tip) / d(turns), (k, 3, e); and closer to one
            another, the inverse of mass, damping and stiffness of a step: at which steps, and (f, e, e).
        load: in N m, (N, e).
        offset: of the motors from where the load was worked out, and its rate, in rad and rad/s, (N, 2, 6).
        springs: springs and dampers, linear, (2, e).
        gears: (6, 6), see `robots.identification.response_kernels.gear_step`.
        start: turns at rest in rad, (e,).
        shapes: and their rates, (N, 2, c).
        every: steps from one derivative of the tip to the next.
        moved: turns of the joints in rad, (N, e); written.
        torque: of the gears on the links in N m against their turns, (N, 6); written.
        derived: d(tip) / d(unknowns) in m/rad, (m, 3, n); written.
    """
    at, motion, rest, levers, close, inverse = posture
    e, n = springs.shape[1], MOVED * shapes.shape[2]
    x, v, a = start.copy(), np.zeros(e), np.zeros(e)
    turn, z = x[:_GEARS] - offset[0, 0], np.zeros(_GEARS)
    Y, by = np.zeros((3 * e, n)), np.zeros((2, _GEARS, n))
    S, motion_now = np.empty((e, e)), np.empty((e, 2 * e))
    rest_now, lever = np.empty((1, e)), np.empty((3, e))
    found = np.zeros((_GEARS, 10))
    knot, last_close, first = 0, 0, 0
    while first < len(shapes) and not shapes[first].any():
        first += 1
    for step in range(len(load)):
        knot, share = place_of(at, knot, step)
        if step:
            last_close, gone = place_of(close, last_close, step)
            between(inverse, last_close, gone, S)
            between(motion, knot, share, motion_now)
            between(rest, knot, share, rest_now)
            state, torques = (x, v, a), (load[step], offset[step], springs, gears)
            advance(state, S, motion_now, rest_now[0], torques, turn, z, h, found)
            if n and step >= first:
                _next_derivatives(Y, by, S, motion_now, gears, found, springs, shapes[step], h)
            for j in range(_GEARS):
                turn[j], z[j] = x[j] - offset[step, 0, j], found[j, 1]
                torque[step, j] = found[j, 0]
        moved[step] = x
        if n and step % every == 0:
            between(levers, knot, share, lever)
            derived[step // every] = np.dot(lever, Y[:e])
    torque[0] = torque[1]


@compiled
def _next_derivatives(Y, by, S, motion, gears, found, springs, shape, h):
    """Derivatives by the unknowns, from the beginning of a step to its end, in place.

    Args:
        Y: of turns, their rates and accelerations, (3 e, n).
        by: of turn and hysteresis of the gears, (2, 6, n).
        S: what torques accelerate, (e, e).
        motion: stiffness and Coriolis terms of the motion, (e, 2 e).
        gears, found: see `robots.identification.response_kernels.gear_step`.
        springs: springs and dampers, linear, (2, e).
        shape: shapes and their rates at the end of the step, (2, c).
        h: step in s.
    """
    e, n = len(S), Y.shape[1]
    P, whole = np.empty((2 * e, n)), -motion
    for j in range(e):
        whole[j, j] -= found[j, 2] if j < _GEARS else springs[0, j]
        whole[j, e + j] -= found[j, 3] if j < _GEARS else springs[1, j]
        for u in range(n):
            P[j, u] = Y[j, u] + h * Y[e + j, u] + (0.5 - BETA) * h * h * Y[2 * e + j, u]
            P[e + j, u] = Y[e + j, u] + (1.0 - GAMMA) * h * Y[2 * e + j, u]
    rhs, state = np.dot(whole, P), np.empty((_GEARS, n))
    slope, J = np.empty(_GEARS), np.eye(_GEARS)
    for j in range(_GEARS):
        for u in range(n):
            state[j, u] = found[j, 4] * by[1, j, u] - found[j, 5] * by[0, j, u]
            rhs[j, u] -= gears[j, 4] * state[j, u]
        for i in range(shape.shape[1] if j < MOVED else 0):
            rhs[j, MOVED * i + j] += found[j, 2] * shape[0, i] + found[j, 3] * shape[1, i]
        stiffer, damper = found[j, 2] - springs[0, j], found[j, 3] - springs[1, j]
        slope[j] = stiffer * BETA * h * h + damper * GAMMA * h
        for i in range(_GEARS):
            J[i, j] += S[i, j] * slope[j]
    a = np.dot(S, rhs)
    of_gears = np.linalg.solve(J, np.ascontiguousarray(a[:_GEARS]))
    for j in range(_GEARS):
        of_gears[j] *= slope[j]
    a -= np.dot(np.ascontiguousarray(S[:, :_GEARS]), of_gears)
    for u in range(n):
        for j in range(e):
            Y[j, u] = P[j, u] + BETA * h * h * a[j, u]
            Y[e + j, u] = P[e + j, u] + GAMMA * h * a[j, u]
            Y[2 * e + j, u] = a[j, u]
    by[0] = Y[:_GEARS]
    for j in range(_GEARS):
        for i in range(shape.shape[1] if j < MOVED else 0):
            by[0, j, MOVED * i + j] -= shape[0, i]
        for u in range(n):
            by[1, j, u] = found[j, 5] * by[0, j, u] + state[j, u]
