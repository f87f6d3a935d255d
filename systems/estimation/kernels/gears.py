"""What gears do beyond their springs, one instant after another."""

import math

import numpy as np

from robots.compiled import compiled
from systems.estimation.kernels.information import factor, unmix

_LEAST_TORQUE = 1e-6  # N m, so that a gear which nothing holds has a side


@compiled
def springs(compliance, gap, factors, sizes):
    """See `GearErrors.springs`; ``sizes`` are those of all shapes, open and held gap last, (7, n)."""
    out = np.empty((2, len(compliance)))
    for j in range(len(compliance)):
        out[0, j] = max(factors[j], gap.least) * compliance[j]
        out[1, j] = max(sizes[5, j] + sizes[6, j], gap.halves[0])
    return out


@compiled
def step(springs, gap, torque, duration, is_first, state):
    """Loads gears for a time; see `GearErrors.step`.

    Args:
        springs: their compliance in rad per N m and half of their play in rad, (2, n).
        gap: `Gap`, with m models.
        torque: of the gears, N m, (n,), for the duration in s.
        is_first: whether nothing is known of what was before.
        state: (1 + 3 m, n): where the teeth are in an open gap; and of each model the deflection of spring
            and gap together in rad, that of the hysteresis in rad, and where the teeth are in a gap that it
            holds; is renewed.
    """
    for j in range(len(torque)):
        compliance = springs[0, j]
        held = gap.held / compliance  # N m/rad
        side = -1.0 if torque[j] > 0.0 else 1.0 if torque[j] < 0.0 else 0.0
        free = state[0, j] - duration / (gap.grease * springs[1, j]) * torque[j]
        state[0, j] = side if is_first else min(max(free, -1.0), 1.0)
        for m in range(len(gap.widths)):
            k, width, half = 1 + 3 * m, gap.widths[m], max(springs[1, j], gap.halves[m])
            if is_first:
                state[k, j] = half * side - compliance * torque[j]
                state[k + 1, j], state[k + 2, j] = 0.0, side
                continue
            # Implicit in the spring of the hysteresis, which goes along with the teeth.
            z, teeth = state[k + 1, j], state[k + 2, j]
            pace, spring = duration / (gap.grease * half), held * half
            push = torque[j] + held * z - spring * teeth
            way = (teeth - pace * push) / (1.0 + pace * spring)
            state[k + 2, j] = min(max(way, -1.0), 1.0)
            deflection = half * state[k + 2, j] - compliance * (torque[j] + held * z)
            turn = deflection - state[k, j]
            end = width if turn > 0.0 else -width
            state[k, j] = deflection
            state[k + 1, j] = end + (z - end) * math.exp(-abs(turn) / width)


@compiled
def mix(gap, state, shares, states):
    """What models expect together: hysteresis, teeth in an open gap and in one that is held, (18,).

    Args:
        gap, state: as of `step`.
        shares: of the models, (m, n).
        states: is written; hysteresis in units of the first width.
    """
    n = shares.shape[1]
    for j in range(n):
        z = teeth = 0.0
        for m in range(len(shares)):
            z += shares[m, j] * state[2 + 3 * m, j]
            teeth += shares[m, j] * state[3 + 3 * m, j]
        states[j], states[n + j], states[2 * n + j] = z / gap.widths[0], state[0, j], teeth


@compiled
def differ(gap, state, states, sizes, others):
    """By how much links would be further ahead, rad, (m, n), if each model alone were right.

    Args:
        gap, state, states: as of `mix`.
        sizes: of the shapes in rad, (7, n).
        others: is written.
    """
    n = others.shape[1]
    for m in range(len(others)):
        for j in range(n):
            z, teeth = state[2 + 3 * m, j] / gap.widths[0], state[3 + 3 * m, j]
            others[m, j] = sizes[4, j] * (z - states[j]) + sizes[6, j] * (teeth - states[2 * n + j])


@compiled
def weigh(J, r, weights, others, limits, against):
    """Renews what speaks against models, (m, n), see `GearErrors.weigh`.

    Args:
        J, r, weights, others, against: as there.
        limits: standard deviations beyond which a sample says nothing; how much one counts; what is kept of
            what spoke against models before.
    """
    usual, share, kept = limits
    for i in range(6):
        if r[i] ** 2 * weights[i] > usual**2:
            return
    for j in range(others.shape[1]):
        pull = stiff = 0.0
        for i in range(6):
            pull += J[i, j] * weights[i] * r[i]
            stiff += J[i, j] ** 2 * weights[i]
        for m in range(len(others)):
            d = others[m, j]
            against[m, j] = kept * against[m, j] + share * d * (0.5 * d * stiff - pull)


@compiled
def believe(before, against, likely):
    """Writes how likely models are, (m, n), from how likely they were and what speaks against them."""
    for j in range(against.shape[1]):
        least, total = against[0, j], 0.0
        for m in range(len(against)):
            least = min(least, against[m, j])
        for m in range(len(against)):
            likely[m, j] = before[m, j] * math.exp(least - against[m, j])
            total += likely[m, j]
        for m in range(len(against)):
            likely[m, j] /= total


@compiled
def variances(compliance, gap, sizes, states, torque, least, out):
    """What the shapes may be off by, rad^2, (n,); see `GearErrors.variances`.

    Args:
        compliance: rad per N m, (n,).
        gap: `Gap`.
        sizes, states, torque: as there.
        least: rad^2, that they are off by in any case.
        out: is written.
    """
    n = len(out)
    sizes, size_variances = sizes
    torque, torque_variances = torque
    for j in range(n):
        spring, square = gap.held / compliance[j], (sizes[5, j] + sizes[6, j]) ** 2
        square += size_variances[5, j] + size_variances[6, j]
        carried = spring * gap.widths[0] * states[j]
        variance = carried**2 + 4.0 * spring**2 * square + torque_variances[j]
        unsure = max(math.sqrt(variance), _LEAST_TORQUE)
        expected = -math.erf((torque[j] + 0.5 * carried) / (math.sqrt(2.0) * unsure))
        off = unknown = 0.0
        for k in (1, 2):
            away = states[n * k + j] - expected  # of halves of the gap
            off += sizes[4 + k, j] * away
            unknown += size_variances[4 + k, j] * away**2
        out[j] = off**2 + unknown + square * (1.0 - expected**2) + least


@compiled
def known(x, sigma, P, starts, loads, sizes, torque):
    """What is known of the shapes' sizes and of what gears carry; see `TipModel.gear_variances`.

    Args:
        x, P: the unknowns and their covariance in units of their spreads ``sigma``.
        starts: where the load and the sizes begin among them.
        loads: of one instant, (m + 1, at least n), the first without the load.
        sizes: of the shapes in rad and their variances, (2, k, n), are written.
        torque: of the gears in N m and its variances, (2, n), are written.
    """
    load, size = starts
    for k in range(sizes.shape[1]):
        for j in range(sizes.shape[2]):
            i = size + k * sizes.shape[2] + j
            sizes[0, k, j], sizes[1, k, j] = x[i], sigma[i] ** 2 * P[i, i]
    for j in range(torque.shape[1]):
        torque[0, j], torque[1, j] = loads[0, j], 0.0
        for i in range(len(loads) - 1):
            torque[0, j] += x[load + i] * loads[1 + i, j]
            for k in range(len(loads) - 1):
                both = sigma[load + i] * P[load + i, load + k] * sigma[load + k]
                torque[1, j] += loads[1 + i, j] * both * loads[1 + k, j]


@compiled
def seen(by_gears, excess, weights, by_joints, least, out):
    """What gears may be off by, as far as it is seen, rad^2, (n,); see `Unmodelled.joint_variances`.

    Args:
        by_gears: what they are said to be off by, (n,).
        excess, weights, by_joints: sums over blocks, (n,) each.
        least: share of what they are said to be off by that is left.
        out: is written.
    """
    for j in range(len(out)):
        share = 1.0 + excess[j] / max(by_joints[j], 1e-300)
        out[j] = by_gears[j] * min(max(share, least), 1.0) + max(excess[j], 0.0) / max(weights[j], 1e-300)


@compiled
def follow(J, r, weights, usual, by_model, variances, kept, off, P):
    """Takes one sample into what joints are off by; see `GearFeedback.hear`.

    Args:
        J, r, weights, variances: as there.
        usual: standard deviations of the camera beyond which a sample says nothing.
        by_model: covariance of what else there is of errors in a sample, (6, 6).
        kept: of what joints are off by, since the last sample.
        off: rad, (n,); is renewed, as is its covariance ``P`` (n, n).
    """
    n = len(off)
    for j in range(n):
        off[j] *= kept
        for k in range(n):
            P[j, k] *= kept**2
        P[j, j] += (1.0 - kept**2) * variances[j]
    for i in range(6):
        if r[i] ** 2 * weights[i] > usual**2:
            return
    V, z, L = np.empty((6, n)), np.empty(6), np.empty((6, 6))  # L L^T is the covariance of r
    for i in range(6):
        z[i] = r[i]
        for j in range(n):
            z[i] -= J[i, j] * off[j]
            V[i, j] = 0.0
            for k in range(n):
                V[i, j] += J[i, k] * P[k, j]
    for i in range(6):
        for h in range(i + 1):
            L[i, h] = by_model[i, h] + (1.0 / weights[i] if h == i else 0.0)
            for k in range(n):
                L[i, h] += V[i, k] * J[h, k]
    factor(L)
    unmix(L, V)
    unmix(L, z.reshape(6, 1))
    for i in range(6):
        for j in range(n):
            off[j] += V[i, j] * z[i]
    for j in range(n):
        for k in range(n):
            for i in range(6):
                P[j, k] -= V[i, j] * V[i, k]


@compiled
def shapes(turns, states, out):
    """Sine and cosine of one and two turns of motors at angles in rad (n,), then the states; (7, n)."""
    for j in range(len(turns)):
        sine, cosine = math.sin(turns[j]), math.cos(turns[j])
        out[0, j], out[1, j] = sine, cosine
        out[2, j], out[3, j] = 2.0 * sine * cosine, cosine * cosine - sine * sine
        for k in range(3):
            out[4 + k, j] = states[len(turns) * k + j]
