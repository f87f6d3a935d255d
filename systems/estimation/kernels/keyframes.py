"""What keyframes say of the unknowns, read anew, compiled."""

import numpy as np

from robots.compiled import compiled, inner
from systems.estimation.kernels.arrays import (
    GEARS,
    MOTION,
    POSE,
    SHAPES,
    THETA,
    TIME,
    TWIST,
    WEIGHT,
    SeenOnce,
)
from systems.estimation.kernels.information import add_squares, complete, whiten
from systems.estimation.kernels.poses import error, move
from systems.estimation.kernels.tip import predict_one_anew


@inner
def _gears(row):
    """Shapes of gear errors, (7, 6) or (0, 6), and what gears may be off by beside them, (6,) or (0,)."""
    shapes = row[SHAPES:].reshape((len(row) - SHAPES) // 6, 6)
    last = max(len(shapes) - 1, 0)
    return shapes[:last], row[SHAPES + 6 * last :]


@compiled
def read(c, unknowns, masses, xi, keyframes, first, until, weights, A, b):
    """Adds what some keyframes say, linear about xi; renews the deflections of their gears.

    Args:
        c, unknowns, masses: the arm at xi, (n,).
        keyframes: rows in a ring, (length, row).
        first, until: numbers of those that are read.
        weights: of the six entries of a pose error.
        A: (n, n), b: (n,), are added to.
    """
    length, number = len(keyframes), len(xi)
    X_WE, H, y, shares = np.empty((4, 4)), np.empty((6, number)), np.empty(6), np.empty(6)
    columns = np.empty((6, len(c.frame)))
    for k in range(first, until):
        row = keyframes[k % length]
        shapes, by_gears = _gears(row)
        seen = SeenOnce(row[TWIST:TIME], row[TIME], shapes)
        moving = row[MOTION:TWIST]
        arm = row[THETA:GEARS], row[GEARS:MOTION], moving
        predict_one_anew(c, unknowns, masses, *arm, seen, X_WE, H, columns)
        error(row[POSE:WEIGHT].reshape(3, 4), X_WE, y)
        for i in range(6):
            shares[i] = row[WEIGHT] * weights[i]
            for j in range(number):
                y[i] += H[i, j] * xi[j]
        if len(by_gears):
            whiten(columns, by_gears, weights, H, y)
            for i in range(6):
                shares[i] = row[WEIGHT]
        add_squares(H, shares, y, A, b)
    complete(A)


@compiled
def merge(c, unknowns, masses, xi, opened, row):
    """Makes a row of the samples of an open keyframe: one pose at their mean, with their mean error.

    Args:
        c, unknowns, masses: the arm at xi, (n,).
        opened: `OpenKeyframe`; its A is completed.
        row: is written.
    """
    complete(opened.A)
    total, means, number = opened.weight[0], opened.means, len(xi)
    for k in range(POSE):
        row[k] = means[k] / total
    for k in range(POSE, len(means)):
        row[SHAPES - POSE + k] = means[k] / total
    row[WEIGHT] = total
    X_WE, H, y = np.empty((4, 4)), np.empty((6, number)), np.empty(6)
    columns, shapes = np.empty((6, len(c.frame))), _gears(row)[0]
    seen = SeenOnce(row[TWIST:TIME], row[TIME], shapes)
    moving = row[MOTION:TWIST]
    arm = row[THETA:GEARS], row[GEARS:MOTION], moving
    predict_one_anew(c, unknowns, masses, *arm, seen, X_WE, H, columns)
    for i in range(6):
        y[i] = opened.y[i]
        for j in range(number):
            y[i] -= opened.H[i, j] * xi[j]
        y[i] /= total
    move(X_WE, y)
    for i in range(3):
        for j in range(4):
            row[POSE + 4 * i + j] = X_WE[i, j]
