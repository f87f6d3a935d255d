"""Sums of what samples say, in information form."""

import math

import numpy as np

from robots.compiled import compiled, inner


@compiled
def take(r, gears, H, xi, seen, noise, weight, keyframe, known, limits):
    """Adds six equations r = H (x - xi) to an open keyframe, and finds the estimate that follows.

    Args:
        r: (6,), gears: deflections in rad, (6,), H: (6, n), xi: (n,), renewed by `estimate`.
        seen: theta, motion, twist, s since the first stamp and shapes of the gears' errors of this instant.
        noise: weights of the equations, (6,), all times ``weight``; and J and by_gears as of `whiten`, (6, 6)
            and (0,) where no gear errs.
        keyframe: `OpenKeyframe`; is renewed, of its A the lower half.
        known: P, (n, n), the covariance without this sample, and how many have been taken into it, (1,), both
            renewed, infinitely many if it is no covariance; b, xi_sum, sigma and g as of `estimate`.
        limits: rad, how far the robot may go from its first sample before the keyframe is to be closed; and
            the trust of `estimate`.

    Returns:
        Whether the robot is further away than that.
    """
    theta, motion, twist, time, shapes = seen
    weights, J, by_gears = noise
    P, taken, b, xi_sum, sigma, g = known
    step, trust = limits
    n = len(xi)
    shares, errors, means = np.empty(6), np.empty(6), keyframe.means
    scaled, rows = np.empty((6, n)), H.copy()
    for i in range(6):
        y = r[i]
        for k in range(n):
            y += H[i, k] * xi[k]
        keyframe.y[i] += weight * y
        shares[i], errors[i] = weight * weights[i], y
        for j in range(n):
            keyframe.H[i, j] += weight * H[i, j]
    if len(by_gears):
        whiten(J, by_gears, weights, rows, errors)
        for i in range(6):
            shares[i] = weight
    for i in range(6):
        scale = math.sqrt(shares[i])
        for j in range(n):
            scaled[i, j] = scale * rows[i, j]
    add_squares(rows, shares, errors, keyframe.A, keyframe.b)
    taken[0] = taken[0] + 1.0 if narrow(P, scaled) else np.inf
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
    for i in range(len(by_gears)):
        means[31 + 6 * len(shapes) + i] += weight * by_gears[i]
    estimate(P, b, keyframe.b, xi_sum, sigma, g, trust, xi)
    return is_far


@inner
def whiten(J, by_gears, weights, H, y):
    """Makes errors of six equations independent of each other, each with a variance of one.

    Args:
        J: (6, at least 6), columns of joints.
        by_gears: rad^2, what joints may be off by in a sample beside the camera's noise, (6,).
        weights: of the camera, one over variances, (6,).
        H: (6, n), y: (6,), are replaced by L^-1 H and L^-1 y with the covariance L L^T.
    """
    L = np.empty((6, 6))
    for i in range(6):
        for h in range(i + 1):
            L[i, h] = 1.0 / weights[i] if h == i else 0.0
            for j in range(len(by_gears)):
                L[i, h] += J[i, j] * by_gears[j] * J[h, j]
    factor(L)
    unmix(L, H)
    unmix(L, y.reshape(6, 1))


@inner
def factor(S):
    """Writes L into the lower half of S = L L^T, (6, 6), of which that is read; says whether there is one."""
    for i in range(6):
        for h in range(i + 1):
            left = S[i, h]
            for m in range(h):
                left -= S[i, m] * S[h, m]
            if h < i:
                S[i, h] = left / S[h, h]
            elif left > 0.0:
                S[i, i] = math.sqrt(left)
            else:
                return False
    return True


@inner
def unmix(L, rows):
    """Writes L^-1 rows in the place of rows, (6, n), of the lower half of L, (6, 6)."""
    n = rows.shape[1]
    for i in range(6):
        row = rows[i]
        for h in range(i):
            share, above = L[i, h], rows[h]
            for k in range(n):
                row[k] -= share * above[k]
        scale = 1.0 / L[i, i]
        for k in range(n):
            row[k] *= scale


@inner
def narrow(P, G):
    """P = A^-1 becomes (A + G^T G)^-1; says whether it can, else it stays as it is.

    That is P - V^T (1 + V G^T)^-1 V with V = G P, of six rows.

    Args:
        P: symmetric, (n, n), is renewed.
        G: (6, n).
    """
    V = np.dot(G, P)
    S = np.dot(V, G.T)
    for i in range(6):
        S[i, i] += 1.0
    if not factor(S):
        return False
    unmix(S, V)
    n = len(P)
    add_squares(V, np.full(6, -1.0), np.zeros(6), P, np.zeros(n))
    complete(P)
    return True


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
def invert(L, P):
    """P = (L L^T)^-1, both (n, n), of the lower half of L; P is written."""
    n = len(L)
    inverse = np.zeros((n, n))  # of L
    for i in range(n):
        row, scale = inverse[i], 1.0 / L[i, i]
        for k in range(i):
            factor, above = scale * L[i, k], inverse[k]
            for j in range(k + 1):
                row[j] -= factor * above[j]
        row[i] = scale
    ones, zeros, unused = np.ones(6), np.zeros(6), np.zeros(n)
    rows = np.zeros((6, n))
    # Number by number: numba takes seconds to compile the assignment of a slice.
    for i in range(n):
        for k in range(n):
            P[i, k] = 0.0
    for first in range(0, n, 6):
        end = min(first + 6, n)
        for i in range(6):
            for k in range(n):
                rows[i, k] = inverse[first + i, k] if first + i < end else 0.0
        add_squares(rows[:, :end], ones, zeros, P[:end, :end], unused[:end])
    complete(P)


@compiled
def estimate(P, b, b_open, xi_sum, sigma, g, trust, xi):
    """xi = P (b + b_open), but near where the sums are linear.

    Args:
        P, b, b_open: (n, n) and (n,).
        xi_sum: (n,), from which no step is larger than the trust in the first g unknowns.
        sigma: units of the unknowns, (n,); trust: m or rad.
        xi: (n,), is renewed.
    """
    n = len(b)
    found = np.dot(P, b + b_open)
    largest = 1e-12
    for k in range(g):
        largest = max(largest, abs((found[k] - xi_sum[k]) * sigma[k]))
    share = min(1.0, trust / largest)
    for k in range(n):
        xi[k] = xi_sum[k] + share * (found[k] - xi_sum[k])
