"""The tip of an elastic arm and its columns at n pairs of one instant each, compiled."""

import numpy as np

from robots.compiled import compiled, inner
from systems.estimation.kernels.arrays import SeenOnce
from systems.estimation.kernels.geometry import place
from systems.estimation.kernels.loads import load
from systems.estimation.kernels.poses import error, move


@compiled
def largest_change(x, y, first):
    """The largest difference of the first entries of two vectors."""
    largest = 0.0
    for k in range(first):
        largest = max(largest, abs(x[k] - y[k]))
    return largest


@compiled
def largest_step(xi, before, sigma, first):
    """The same of unknowns in units of their spreads."""
    largest = 0.0
    for k in range(first):
        largest = max(largest, abs((xi[k] - before[k]) * sigma[k]))
    return largest


@compiled
def stay_near(x, x_geometry, step, of):
    """Makes x the geometry where it is further than a step away; says whether it is the one ``of`` still."""
    if largest_change(x, x_geometry, len(of)) > step:
        for k in range(len(x)):
            x_geometry[k] = x[k]
    return largest_change(of, x_geometry, len(of)) == 0.0


@inner
def deflect(unknowns, g, loads, unit, yields):
    """Deflections in rad for a factor of one, and with the factors of now, (18,) each."""
    x = unknowns.x
    for j in range(18):
        total = loads[0, j]
        for k in range(4):
            total += x[g + 18 + k] * loads[1 + k, j]
        unit[j] = -unknowns.compliance[j] * total
        yields[j] = x[g + j] * unit[j]


@inner
def _error_of_gear(unknowns, g, shapes, j):
    total, first = 0.0, g + 24
    for k in range(len(shapes)):
        total += shapes[k, j] * unknowns.x[first + 6 * k + j]
    return total


@inner
def move_by_geometry(c, x, columns, X_WE, step):
    """Moves the tip from the geometry of the constants to that of the unknowns; ``step`` is room for six."""
    for i in range(6):
        step[i] = 0.0
        for k in range(len(c.chosen)):
            step[i] += columns[i, 18 + k] * (x[k] - c.chosen[k])
    move(X_WE, step)


@inner
def _complete(unknowns, g, loads, unit, yields, seen, columns, X_WE, H):
    """Adds the tilting bearings and the clock to a pose, and makes the columns."""
    x, sigma = unknowns.x, unknowns.sigma
    clock, time, step = x[g + 22], seen.time, np.empty(6)
    for i in range(6):
        twist = seen.twist[i]
        step[i] = twist * clock + time * twist * x[g + 23]
        for j in range(6, 18):
            step[i] += columns[i, j] * yields[j]
        for k in range(g):
            H[i, k] = columns[i, 18 + k] * sigma[k]
        for j in range(18):
            H[i, g + j] = columns[i, j] * unit[j] * sigma[g + j]
        for k in range(4):
            total = 0.0
            for j in range(18):
                total += columns[i, j] * (-x[g + j] * unknowns.compliance[j]) * loads[1 + k, j]
            H[i, g + 18 + k] = total * sigma[g + 18 + k]
        H[i, g + 22], H[i, g + 23] = twist * sigma[g + 22], time * twist * sigma[g + 23]
        for k in range(g + 24, len(x)):
            H[i, k] = 0.0
        for k in range(len(seen.shapes)):
            for j in range(6):
                entry = g + 24 + 6 * k + j
                H[i, entry] = columns[i, j] * seen.shapes[k, j] * sigma[entry]
    move(X_WE, step)


@inner
def predict_one(c, unknowns, theta, loads, seen, X_WE, H, gears, columns):
    """`predict` for one instant, with `SeenOnce`; writes the columns of the arm, too, (6, C)."""
    g = len(c.chosen)
    unit, yields, q, step = np.empty(18), np.empty(18), np.empty(6), np.empty(6)
    frames = np.empty((7, 4, 4))
    deflect(unknowns, g, loads, unit, yields)
    for j in range(6):
        gears[j] = yields[j]
        q[j] = theta[j] + yields[j] + _error_of_gear(unknowns, g, seen.shapes, j)
    place(c, q, X_WE, frames, columns)
    move_by_geometry(c, unknowns.x, columns, X_WE, step)
    _complete(unknowns, g, loads, unit, yields, seen, columns, X_WE, H)


@compiled
def predict(c, unknowns, theta, loads, seen, X_WE, H, gears):
    """The tip at encoder positions.

    Args:
        c: `Constants` of a geometry near that of the unknowns.
        unknowns: `Unknowns`.
        theta: encoder positions in rad, (n, 6).
        loads: (n, 5, 18).
        seen: `Seen`.
        X_WE: (n, 4, 4), H: (n, 6, size), gears: deflections in rad (n, 6), are written.
    """
    columns = np.empty((6, len(c.frame)))
    for n in range(len(theta)):
        once = SeenOnce(seen.twist[n], seen.time[n], seen.shapes[n])
        predict_one(c, unknowns, theta[n], loads[n], once, X_WE[n], H[n], gears[n], columns)


@compiled
def innovation(c, unknowns, theta, loads, seen, X_seen, r, H, gears, columns):
    """How far the camera sees the tip from where it is predicted, (6,), beside what `predict_one` writes."""
    X_WE = np.empty((4, 4))
    predict_one(c, unknowns, theta, loads, seen, X_WE, H, gears, columns)
    error(X_seen, X_WE, r)


@inner
def predict_one_anew(c, unknowns, masses, theta, gears, motion, seen, X_WE, H, columns):
    """`predict_anew` for one instant, with `SeenOnce`; writes the columns of the arm, too, (6, C)."""
    g = len(c.chosen)
    unit, yields, q, step = np.empty(18), np.empty(18), np.empty(6), np.empty(6)
    frames, loads = np.empty((7, 4, 4)), np.empty((5, 18))
    for j in range(6):
        q[j] = theta[j] + gears[j] + _error_of_gear(unknowns, g, seen.shapes, j)
    place(c, q, X_WE, frames, columns)
    move_by_geometry(c, unknowns.x, columns, X_WE, step)
    load(masses, frames, q, motion[:6], motion[6:], loads)
    deflect(unknowns, g, loads, unit, yields)
    for i in range(6):
        step[i] = 0.0
        for j in range(6):
            step[i] += columns[i, j] * (yields[j] - gears[j])
    for j in range(6):
        gears[j] = yields[j]
    move(X_WE, step)
    _complete(unknowns, g, loads, unit, yields, seen, columns, X_WE, H)


@compiled
def predict_anew(c, unknowns, masses, theta, gears, motion, seen, X_WE, H):
    """The same with loads worked out anew at the geometry of now.

    Args:
        c, unknowns, theta, seen, X_WE, H: as of `predict`.
        masses: `Masses`.
        gears: about by how much the gears yield in rad, (n, 6); is renewed.
        motion: velocities and accelerations of the joints, (n, 12).
    """
    columns = np.empty((6, len(c.frame)))
    for n in range(len(theta)):
        once = SeenOnce(seen.twist[n], seen.time[n], seen.shapes[n])
        predict_one_anew(c, unknowns, masses, theta[n], gears[n], motion[n], once, X_WE[n], H[n], columns)
