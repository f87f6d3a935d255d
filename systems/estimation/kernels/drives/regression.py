"""The regression of what motors are behind their commands by: its rows, and a step of least squares."""

import math

import numpy as np

from robots.compiled import compiled, inner
from systems.estimation.kernels import drive_columns as at

# Of the believed width over which friction turns over: where it turns over at once, and where within a third;
# in that the sign of a measured speed is not known
SHARP_WIDTH, THIRD_WIDTH = 0.02, 0.3
_STILL = 0.1  # of that width, below which a motor may hang in its friction by plan
_STUCK = 0.3  # likewise as encoders show, whatever is planned
_FORGOTTEN = 0.1  # s, in which what it was off by then has fallen to a third
MATCHED = 0.1  # s, over which variances follow what the model leaves of following errors


@compiled
def features(v, a, rows, Phi):
    """The equations of six joints, Phi (6, 75), zero before, from regressors; see `DriveModel.features`."""
    for i in range(6):
        Phi[i, at.DEAD_TIME] = Phi[i, at.LAG + i] = v[i] + rows[at.ROW_RATE, i]
        Phi[i, at.INERTIA + i] = 1e-2 * a[i]
        for k in range(at.OF_FRICTION):
            Phi[i, at.FRICTION + at.OF_FRICTION * i + k] = rows[at.ROW_FRICTION + k, i]
        Phi[i, at.CONSTANT + i] = 1.0
        for k in range(4):
            Phi[i, at.MASS + k] = rows[at.ROW_LOADS + k, i]
        Phi[i, at.SMOOTHED] = rows[at.ROW_SMOOTHED, i]
        Phi[i, at.SHARP + i] = rows[at.ROW_SHARP, i]
        Phi[i, at.NOT_HELD + i] = rows[at.ROW_NOT_HELD, i]
        Phi[i, at.GIVING + i] = rows[at.ROW_GIVING, i]
        Phi[i, at.THIRD + i] = rows[at.ROW_THIRD, i]
        for k in range(3):
            Phi[i, at.OTHER_GAINS + k] = rows[at.ROW_OTHER_GAINS + k, i]


@compiled
def deviate(drives, v, dv, da, last, z, out):
    """Goes on by a period with what motors needed otherwise than planned, as they moved otherwise.

    Args:
        drives: `Drives`.
        v: planned speeds, rad/s, (6,).
        dv, da: by how much speeds and accelerations were more, rad/s and rad/s^2, (6,).
        last: (6, 6), torques a period ago: in all, of rotor, viscous and Coulomb friction, its hump, and
            what it turns over more sharply, at once or within a third; is renewed.
        z: (6, 6, 2), integral of the following error and error of each; is renewed.
        out: (6, 6) rad, those errors; is written.
    """
    w = np.empty(6)
    for i in range(6):
        coulomb, width, u = drives.coulomb[i], drives.width[i], v[i] + dv[i]
        third, sign, before = THIRD_WIDTH * width, math.tanh(u / width), math.tanh(v[i] / width)
        w[1], w[2], w[3] = drives.rotor[i] * da[i], drives.viscous[i] * dv[i], coulomb * (sign - before)
        hump = sign * math.exp(-abs(u) / drives.slow) - before * math.exp(-abs(v[i]) / drives.slow)
        w[4] = coulomb * hump
        w[5] = coulomb * (math.tanh(u / third) - math.tanh(v[i] / third)) - w[3]
        w[0] = drives.inertia[i] * da[i] + w[2] + w[3]
        filter_errors(drives.step[0, i], z[:, i], last[:, i], w)
        for k in range(6):
            last[k, i], out[k, i] = w[k], z[k, i, 1]


@inner
def behind(v, a, rows, beta, i):
    """The equation of a joint: its rows times the parameters."""
    rate = v + rows[at.ROW_RATE, i]
    total = rate * beta[at.DEAD_TIME] + rate * beta[at.LAG + i] + 1e-2 * a * beta[at.INERTIA + i]
    for k in range(at.OF_FRICTION):
        total += rows[at.ROW_FRICTION + k, i] * beta[at.FRICTION + at.OF_FRICTION * i + k]
    for k in range(4):
        total += rows[at.ROW_LOADS + k, i] * beta[at.MASS + k]
    for k in range(3):
        total += rows[at.ROW_OTHER_GAINS + k, i] * beta[at.OTHER_GAINS + k]
    smoothed, sharp = rows[at.ROW_SMOOTHED, i] * beta[at.SMOOTHED], rows[at.ROW_SHARP, i] * beta[at.SHARP + i]
    total += smoothed + sharp + rows[at.ROW_THIRD, i] * beta[at.THIRD + i]
    total = total + beta[at.CONSTANT + i] + rows[at.ROW_NOT_HELD, i] * beta[at.NOT_HELD + i]
    return total + rows[at.ROW_GIVING, i] * beta[at.GIVING + i]


@compiled
def learn(P, beta, Phi, y, variances, misfit, fading):
    """Takes six equations y = Phi beta of variances (6,) into covariance P and parameters beta.

    A joint whose innovations have been larger than both covariances explain counts by as much less: what its
    model leaves is no noise, and would be taken for what the others share with it. Their mean square beyond
    P is ``misfit`` (6,), which is renewed and fades by a factor in each step.
    """
    n, m = len(beta), len(y)
    # Transposed, as rows are quicker.
    PH, S, gain, r = np.zeros((m, n)), np.zeros((m, m)), np.empty((m, n)), np.empty(m)
    for k in range(m):
        for j in range(n):
            if Phi[k, j] != 0.0:  # a joint has a fifth of the columns
                for i in range(n):
                    PH[k, i] += Phi[k, j] * P[j, i]
    for k in range(m):
        r[k] = y[k]
        for i in range(n):
            if Phi[k, i] != 0.0:
                r[k] -= Phi[k, i] * beta[i]
                for j in range(m):
                    S[k, j] += Phi[k, i] * PH[j, i]
        misfit[k] = fading * misfit[k] + (1.0 - fading) * (r[k] * r[k] - S[k, k])
        S[k, k] += max(variances[k], misfit[k])
    # S = L L^T, and gain = P H S^-1 by two triangular solutions.
    for k in range(m):
        for j in range(k + 1):
            total = S[k, j]
            for i in range(j):
                total -= S[k, i] * S[j, i]
            S[k, j] = np.sqrt(total) if j == k else total / S[j, j]
    for k in range(m):
        for i in range(n):
            gain[k, i] = PH[k, i]
        for j in range(k):
            for i in range(n):
                gain[k, i] -= S[k, j] * gain[j, i]
        for i in range(n):
            gain[k, i] /= S[k, k]
    for k in range(m - 1, -1, -1):
        for j in range(k + 1, m):
            for i in range(n):
                gain[k, i] -= S[j, k] * gain[j, i]
        for i in range(n):
            gain[k, i] /= S[k, k]
    for k in range(m):
        for i in range(n):
            beta[i] += gain[k, i] * r[k]
    for i in range(n):
        row = P[i]
        for k in range(0, m, 2):  # two at once, as the row is read and written only once then
            a, b, c, d = 0.5 * gain[k, i], 0.5 * PH[k, i], 0.5 * gain[k + 1, i], 0.5 * PH[k + 1, i]
            one, two, three, four = PH[k], gain[k], PH[k + 1], gain[k + 1]
            for j in range(i + 1):
                row[j] -= a * one[j] + b * two[j] + c * three[j] + d * four[j]
        for j in range(i):
            P[j, i] = row[j]


@compiled
def look_back(drives, planned, beside, rows, actual, deviation, dv, hung, misfit, P, beta, weighing):
    """Learns from one planned instant that has passed; see `DriveModel.look_back`.

    Args:
        drives: `Drives`.
        planned: position, velocity and acceleration of the motors, (6,) each.
        beside: what was commanded beside the plan because of what was learnt, rad, (6,).
        rows: of the regressors, (17, 6), as `command` writes them.
        actual: positions of the motors, rad, (6,).
        deviation: (6, 6) rad, of `deviate`.
        dv: rad/s, by which motors were faster than planned, (6,).
        hung: rad, (2, 6), by which motors were off when they were slow, fading, and are if they are so by
            plan; is renewed.
        misfit, P, beta: as of `learn`.
        weighing: variance of the following error of a motor that does not hang; times what a motor hung by,
            by which its following error may be due to that; rad, that may be unexplained if there shall be
            something to learn.

    Of a motor that moves no more is due to what it hung by than friction may be off by, its slack. Else a
    motor that moves to and fro about its plan, as friction does not turn over as sharply as was learnt, would
    never show that it does not.

    Returns:
        By how much the positions are off at most at the beta from before, beyond the slack, rad.
    """
    theta, v, a = planned
    variance, doubt, most = weighing
    Phi, y, variances = np.zeros((6, len(beta))), np.empty(6), np.empty(6)
    features(v, a, rows, Phi)
    largest, fading = 0.0, math.exp(-drives.period / _FORGOTTEN)
    for i in range(6):
        hung[0, i] *= fading
        off, width = theta[i] - actual[i], drives.width[i]
        is_slow = abs(v[i]) < _STILL * width + 0.5 * drives.period * abs(a[i])
        hung[1, i] = off if is_slow else 0.0
        hangs = abs(v[i] + dv[i]) < _STUCK * width  # then its friction is whatever keeps it there
        if is_slow or hangs:
            hung[0, i] = max(hung[0, i], abs(off))
        doubted = doubt * hung[0, i]
        if not hangs:  # what moves has the friction of its speed, and what it hung by is gone soon
            doubted = min(doubted, drives.slack[i])
        variances[i] = variance + doubted**2
        # Rotors and friction go by how motors move, not by how they should.
        for k in range(at.OF_FRICTION):
            Phi[i, at.FRICTION + at.OF_FRICTION * i + k] += deviation[1 + k, i]
        Phi[i, at.SHARP + i] += deviation[5, i]
        Phi[i, at.THIRD + i] += deviation[5, i]
        y[i] = off + beside[i] - deviation[0, i]
        unexplained = y[i]
        for j in range(len(beta)):
            unexplained -= Phi[i, j] * beta[j]
        largest = max(largest, abs(unexplained) - drives.slack[i])
    if largest <= most:
        learn(P, beta, Phi, y, variances, misfit, math.exp(-drives.period / MATCHED))
    return largest


@inner
def filter_errors(step, z, last, w):
    """e = G w for the torques of one joint, exact for torques that change evenly within a period."""
    for k in range(len(z)):
        integral, e, before, change = z[k, 0], z[k, 1], last[k], w[k] - last[k]
        for i in range(2):
            row = step[i]
            z[k, i] = row[0] * integral + row[1] * e + row[2] * before + row[3] * change
