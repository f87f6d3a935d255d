"""Products of rotations, small motions and errors of poses."""

import math

import numpy as np

from robots.compiled import compiled, inner

_HALF_TURN_SINE = 1e-2  # as in `robots.pose`: below, the sine of an angle near pi does not show its axis


@inner
def multiply(A, B, out):
    """``out = A B`` for the leading 3 x 3 parts."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@compiled
def move(X, step):
    """Moves a pose (4, 4) by a small spatial displacement (6,) in world axes, in place; see `moved`."""
    x, y, z = 0.5 * step[0], 0.5 * step[1], 0.5 * step[2]
    share = 2.0 / (1.0 + x * x + y * y + z * z)
    # share (v~ + v~ v~), the rotation less the identity
    xx, xy, xz = -share * (y * y + z * z), share * (x * y - z), share * (x * z + y)
    yx, yy, yz = share * (x * y + z), -share * (x * x + z * z), share * (y * z - x)
    zx, zy, zz = share * (x * z - y), share * (y * z + x), -share * (x * x + y * y)
    for j in range(3):
        a, b, c = X[0, j], X[1, j], X[2, j]
        X[0, j] = a + (xx * a + xy * b + xz * c)
        X[1, j] = b + (yx * a + yy * b + yz * c)
        X[2, j] = c + (zx * a + zy * b + zz * c)
    for i in range(3):
        X[i, 3] += step[3 + i]


@compiled
def error(X_WD, X_WE, out):
    """`robots.pose.pose_error` of one pair of poses, at least (3, 4), into (6,)."""
    R = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            R[i, j] = X_WD[i, 0] * X_WE[j, 0] + X_WD[i, 1] * X_WE[j, 1] + X_WD[i, 2] * X_WE[j, 2]
        out[3 + i] = X_WD[i, 3] - X_WE[i, 3]
    out[0] = 0.5 * (R[2, 1] - R[1, 2])
    out[1] = 0.5 * (R[0, 2] - R[2, 0])
    out[2] = 0.5 * (R[1, 0] - R[0, 1])
    sine = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    angle = math.atan2(sine, cosine)
    if cosine >= 0.0 or sine >= _HALF_TURN_SINE:
        scale = angle / sine if sine > 0.0 else 1.0
        for i in range(3):
            out[i] *= scale
        return
    # The symmetric part is (1 - cosine) axis axis^T: its largest column shows the axis, its sign the sine.
    k = 0
    for i in range(1, 3):
        if R[i, i] > R[k, k]:
            k = i
    axis = np.empty(3)
    square = along = 0.0
    for i in range(3):
        axis[i] = 0.5 * (R[i, k] + R[k, i]) - (cosine if i == k else 0.0)
        square += axis[i] ** 2
        along += axis[i] * out[i]
    scale = (-angle if along < 0.0 else angle) / math.sqrt(square)
    for i in range(3):
        out[i] = scale * axis[i]


@compiled
def move_all(X, steps):
    """`move` for n poses."""
    for i in range(len(X)):
        move(X[i], steps[i])


@compiled
def pose_errors(X_WD, X_WE):
    """`robots.pose.pose_error` of n pairs of poses, (n, at least 3, 4), shape (n, 6)."""
    out = np.empty((len(X_WD), 6))
    for i in range(len(out)):
        error(X_WD[i], X_WE[i], out[i])
    return out
