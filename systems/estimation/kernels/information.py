"""Sums of what samples say, in information form."""

import math

import numpy as np

from robots.compiled import compiled, inner


@compiled
def take(r, gears, H, xi, seen, weights, weight, keyframe, past, limits):
    """Adds six equations r = H (x - xi) to an open keyframe, and finds the estimate that follows.

    Args:
        r: (6,), gears: deflections in rad, (6,), H: (6, n), xi: (n,), renewed by `estimate`.
        seen: theta, motion, twist, s since the first stamp and shapes of the gears' errors of this instant.
        weights: of the equations, (6,), all times ``weight``.
        keyframe: `OpenKeyframe`; is renewed.
        past: A, b, xi_sum, sigma and g as of `estimate`.
        limits: rad, how far the robot may go from its first sample before the keyframe is to be closed; and
            the trust of `estimate`.

    Returns:
        Whether the robot is further away than that; then xi is as it was.
    """
    theta, motion, twist, time, shapes = seen
    A, b, xi_sum, sigma, g = past
    step, trust = limits
    n = len(xi)
    shares, errors, means = np.empty(6), np.empty(6), keyframe.means
    for i in range(6):
        y = r[i]
        for k in range(n):
            y += H[i, k] * xi[k]
        keyframe.y[i] += weight * y
        shares[i], errors[i] = weight * weights[i], y
        for j in range(n):
            keyframe.H[i, j] += weight * H[i, j]
    add_squares(H, shares, errors, keyframe.A, keyframe.b)
    complete(keyframe.A)
    if keyframe.samples[0] == 0.0:
        for i in range(6):
            keyframe.first_theta[i] = theta[i]
    keyframe.samples[0] += 1.0
    keyframe.weight[0] += weight
    is_far = False
    for i in range(6):
        means[i] += weight * theta[i]
        means[6 + i] += weight * gears[i]
        means[12 + i] += weight * motion[i]
        means[18 + i] += weight * motion[6 + i]
        means[24 + i] += weight * twist[i]
        is_far = is_far or abs(theta[i] - keyframe.first_theta[i]) > step
    means[30] += weight * time
    for k in range(len(shapes)):
        for i in range(6):
            means[31 + 6 * k + i] += weight * shapes[k, i]
    if not is_far:
        estimate(A, keyframe.A, b, keyframe.b, xi_sum, sigma, g, trust, xi)
    return is_far


@inner
def add_squares(H, weights, y, A, b):
    """``A += H^T W H``, of whose A only the lower half is renewed, and ``b += H^T W y``, of six rows."""
    n = len(b)
    h0, h1, h2, h3, h4, h5 = H[0], H[1], H[2], H[3], H[4], H[5]
    for j in range(n):
        w0, w1, w2 = weights[0] * h0[j], weights[1] * h1[j], weights[2] * h2[j]
        w3, w4, w5 = weights[3] * h3[j], weights[4] * h4[j], weights[5] * h5[j]
        b[j] += w0 * y[0] + w1 * y[1] + w2 * y[2] + w3 * y[3] + w4 * y[4] + w5 * y[5]
        row = A[j]
        for k in range(j + 1):
            row[k] += w0 * h0[k] + w1 * h1[k] + w2 * h2[k] + w3 * h3[k] + w4 * h4[k] + w5 * h5[k]


@compiled
def gather(H, y, weights, A, b):
    """`add_squares` for whoever needs nothing else."""
    add_squares(H, weights, y, A, b)


@inner
def complete(A):
    """Writes the upper half of a symmetric matrix from its lower one."""
    for j in range(len(A)):
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
        for k in range(i, n):
            U[i, k] = A[i, k] + A_open[i, k]
        for k in range(m):
            X[i, k] = B[i, k]
    for first in range(0, n, 4):  # four at once, as the rows below are read and written only once then
        end = min(first + 4, n)
        for i in range(first, end):
            for h in range(first, i):
                factor, above, row = U[h, i], U[h, i:], U[i, i:]
                for k in range(len(row)):
                    row[k] -= factor * above[k]
                for k in range(m):
                    X[i, k] -= factor * X[h, k]
            if not U[i, i] > 0.0:
                return False
            scale, row = 1.0 / math.sqrt(U[i, i]), U[i, i:]
            for k in range(len(row)):
                row[k] *= scale
            for k in range(m):
                X[i, k] *= scale
        for j in range(end, n):
            p, q, r, s = U[first, j], U[first + 1, j], U[first + 2, j], U[first + 3, j]
            one, two, three, four = U[first, j:], U[first + 1, j:], U[first + 2, j:], U[first + 3, j:]
            row = U[j, j:]
            for k in range(len(row)):
                row[k] -= p * one[k] + q * two[k] + r * three[k] + s * four[k]
            for k in range(m):
                X[j, k] -= p * X[first, k] + q * X[first + 1, k] + r * X[first + 2, k] + s * X[first + 3, k]
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
