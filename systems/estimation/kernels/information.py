"""Sums of what samples say, in information form."""

import math

import numpy as np

from systems.estimation.kernels.poses import compiled, inner


@compiled
def add_sample(r, H, xi, weights, weight, A, b, sum_y, sum_H):
    """Adds six equations r = H (x - xi) to sums about x.

    Args:
        r: (6,), H: (6, n), xi: (n,).
        weights: of the equations, (6,), all times ``weight``.
        A: sum of H^T W H, (n, n), b: of H^T W y with y = r + H xi, (n,), sum_y, sum_H: of y and H times
            ``weight`` alone; are renewed.
    """
    n = len(xi)
    shares, errors = np.empty(6), np.empty(6)
    for i in range(6):
        y = r[i]
        for k in range(n):
            y += H[i, k] * xi[k]
        sum_y[i] += weight * y
        shares[i], errors[i] = weight * weights[i], y
        for j in range(n):
            sum_H[i, j] += weight * H[i, j]
    add_squares(H, shares, errors, A, b)


@inner
def add_squares(H, weights, y, A, b):
    """``A += H^T W H`` and ``b += H^T W y``, of a symmetric A."""
    n = len(b)
    for j in range(n):
        for i in range(len(y)):
            weighted = weights[i] * H[i, j]
            b[j] += weighted * y[i]
            for k in range(j + 1):
                A[j, k] += weighted * H[i, k]
        for k in range(j):
            A[k, j] = A[j, k]


@compiled
def solve(A, A_open, B, X):
    """Solves (A + A_open) X = B, by Cholesky's method; says whether the sum is positive definite.

    Args:
        A, A_open: symmetric, (n, n).
        B: (n, m).
        X: (n, m), is written.
    """
    n, m = B.shape
    U = np.empty((n, n))  # U^T U, of which each row is finished by those above
    for i in range(n):
        for k in range(n):
            U[i, k] = A[i, k] + A_open[i, k]
        for k in range(m):
            X[i, k] = B[i, k]
    for i in range(n):
        if not U[i, i] > 0.0:
            return False
        scale = 1.0 / math.sqrt(U[i, i])
        above = U[i, i:]
        for k in range(len(above)):
            above[k] *= scale
        for k in range(m):
            X[i, k] *= scale
        for j in range(i + 1, n):
            factor, above, row = U[i, j], U[i, j:], U[j, j:]
            for k in range(len(row)):
                row[k] -= factor * above[k]
            for k in range(m):
                X[j, k] -= factor * X[i, k]
    for i in range(n - 1, -1, -1):
        for k in range(m):
            for j in range(i + 1, n):
                X[i, k] -= U[i, j] * X[j, k]
            X[i, k] /= U[i, i]
    return True


@compiled
def estimate(A, A_open, b, b_open, xi_sum, sigma, g, trust, xi):
    """xi = (A + A_open)^-1 (b + b_open), but near where the sums are linear; no change if there is none.

    Args:
        A, A_open, b, b_open: (n, n) and (n,).
        xi_sum: (n,), from which no step is larger than the trust in the first g unknowns.
        sigma: units of the unknowns, (n,); trust: m or rad.
        xi: (n,), is renewed.
    """
    n = len(b)
    B, X = np.empty((n, 1)), np.empty((n, 1))
    for k in range(n):
        B[k, 0] = b[k] + b_open[k]
    if not solve(A, A_open, B, X):
        return
    largest = 1e-12
    for k in range(g):
        largest = max(largest, abs((X[k, 0] - xi_sum[k]) * sigma[k]))
    share = min(1.0, trust / largest)
    for k in range(n):
        xi[k] = xi_sum[k] + share * (X[k, 0] - xi_sum[k])
