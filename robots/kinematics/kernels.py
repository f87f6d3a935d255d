"""Kinematics and linear equations of one configuration as loops that numba compiles.

Who computes in every tick imports this module when it is made, see `robots.compiled`.
"""

import math

import numpy as np

from robots.compiled import compiled
from robots.kinematics.forward import DAMPING, MANIPULABILITY_THRESHOLD

_TINY = np.finfo(float).tiny


@compiled
def pose_and_jacobian(q, placements, X, J):
    """The tool's pose (3, 4) and the geometric Jacobian (6, 6), rotation first, into X and J.

    Args:
        q: joint positions in rad, (6,).
        placements: of joint after joint in the one before, turned such that it is about z, then of the tool
            in the last; (7, 3, 4).
    """
    origins = np.empty((6, 3))
    product = np.empty((3, 4))
    for i in range(3):
        for j in range(4):
            X[i, j] = placements[0, i, j]
    for joint in range(6):
        s, c = math.sin(q[joint]), math.cos(q[joint])
        for i in range(3):
            J[i, joint] = X[i, 2]
            origins[joint, i] = X[i, 3]
            u, v = X[i, 0], X[i, 1]
            X[i, 0], X[i, 1] = c * u + s * v, c * v - s * u
        Y = placements[joint + 1]
        for i in range(3):
            for j in range(4):
                product[i, j] = X[i, 0] * Y[0, j] + X[i, 1] * Y[1, j] + X[i, 2] * Y[2, j]
            product[i, 3] += X[i, 3]
        for i in range(3):
            for j in range(4):
                X[i, j] = product[i, j]
    for joint in range(6):
        a, b, c = J[0, joint], J[1, joint], J[2, joint]
        x, y, z = X[0, 3] - origins[joint, 0], X[1, 3] - origins[joint, 1], X[2, 3] - origins[joint, 2]
        J[3, joint], J[4, joint], J[5, joint] = b * z - c * y, c * x - a * z, a * y - b * x


@compiled
def solve(A, B):
    """Solves A x = b for the columns b of B, (n, n) and (n, m), in place: the solutions are in B.

    Elimination with pivots from the column, as LAPACK's ``gesv``; A is overwritten.

    Returns:
        The determinant of A; if it is zero, B is not to be used.
    """
    n, determinant = len(A), 1.0
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if pivot != k:
            determinant = -determinant
            for j in range(k, n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            for j in range(B.shape[1]):
                B[k, j], B[pivot, j] = B[pivot, j], B[k, j]
        determinant *= A[k, k]
        if A[k, k] == 0.0:
            return 0.0
        for i in range(k + 1, n):
            share = A[i, k] / A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= share * A[k, j]
            for j in range(B.shape[1]):
                B[i, j] -= share * B[k, j]
    for j in range(B.shape[1]):
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                B[i, j] -= A[i, k] * B[k, j]
            B[i, j] /= A[i, i]
    return determinant


@compiled
def robust_solve(J, V):
    """`robots.kinematics.forward.robust_solve` of twists V as columns, (6, n), into a new array (6, n)."""
    rates = V.copy()
    manipulability = abs(solve(J.copy(), rates))
    if manipulability >= MANIPULABILITY_THRESHOLD:
        return rates
    alpha = DAMPING * (1.0 - manipulability / MANIPULABILITY_THRESHOLD) ** 2
    U, s, Vt = np.linalg.svd(J)
    n, m = V.shape
    for column in range(m):
        for i in range(n):
            rates[i, column] = 0.0
        for k in range(n):
            along = 0.0
            for i in range(n):
                along += U[i, k] * V[i, column]
            along *= s[k] / (s[k] ** 2 + alpha**2 + _TINY)
            for i in range(n):
                rates[i, column] += Vt[k, i] * along
    return rates
