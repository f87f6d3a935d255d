"""Regression of following errors: its rows, and one step of recursive least squares."""

import numpy as np

from systems.estimation.kernels.poses import compiled


@compiled
def features(v, a, filtered, Phi):
    """Rows of the regression, (6, 38), which are zero before; see `DriveModel.features`."""
    for i in range(6):
        Phi[i, 0] = Phi[i, 1 + i] = v[i]
        Phi[i, 7 + i] = 1e-2 * a[i]
        for k in range(3):
            Phi[i, 13 + 3 * i + k] = filtered[6 * k + i]
        Phi[i, 31 + i] = 1.0
        Phi[i, 37] = filtered[18 + i]


@compiled
def learn(P, beta, Phi, y, variance):
    """Takes six equations y = Phi beta of one variance into covariance P and parameters beta."""
    n, m = len(beta), len(y)
    PH, S, gain, r = np.zeros((n, m)), np.zeros((m, m)), np.empty((n, m)), np.empty(m)
    for i in range(n):
        for k in range(m):
            for j in range(n):
                PH[i, k] += P[i, j] * Phi[k, j]
    for k in range(m):
        r[k] = y[k]
        S[k, k] = variance
        for i in range(n):
            r[k] -= Phi[k, i] * beta[i]
            for j in range(m):
                S[k, j] += Phi[k, i] * PH[i, j]
    # S = L L^T, and gain = P H S^-1 by two triangular solutions a row.
    for k in range(m):
        for j in range(k + 1):
            total = S[k, j]
            for i in range(j):
                total -= S[k, i] * S[j, i]
            S[k, j] = np.sqrt(total) if j == k else total / S[j, j]
    for i in range(n):
        for k in range(m):
            total = PH[i, k]
            for j in range(k):
                total -= S[k, j] * gain[i, j]
            gain[i, k] = total / S[k, k]
        for k in range(m - 1, -1, -1):
            total = gain[i, k]
            for j in range(k + 1, m):
                total -= S[j, k] * gain[i, j]
            gain[i, k] = total / S[k, k]
    for i in range(n):
        for k in range(m):
            beta[i] += gain[i, k] * r[k]
        for j in range(i + 1):
            change = 0.0
            for k in range(m):
                change += 0.5 * (gain[i, k] * PH[j, k] + gain[j, k] * PH[i, k])
            P[i, j] = 0.5 * (P[i, j] + P[j, i]) - change
            P[j, i] = P[i, j]


@compiled
def filtered(step, z, last, w):
    """e = G w for several torques, exact for torques that change evenly within a period.

    Args:
        step: (6, 2, 4), a period's step from state, torque and its change to the state.
        z: (m, 6, 2), integral of e and e; is renewed.
        last, w: torques a period ago and now, (m, 6).
    """
    for k in range(len(z)):
        for j in range(6):
            integral, e, before, change = z[k, j, 0], z[k, j, 1], last[k, j], w[k, j] - last[k, j]
            for i in range(2):
                row = step[j, i]
                z[k, j, i] = row[0] * integral + row[1] * e + row[2] * before + row[3] * change
