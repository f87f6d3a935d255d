"""What gears do beyond their springs, one instant after another."""

import math

import numpy as np

from robots.compiled import compiled


@compiled
def springs(compliance, gap, factors, sizes):
    """See `GearErrors.springs`; ``sizes`` are those of all shapes, open and held gap last, (7, n)."""
    out = np.empty((2, len(compliance)))
    for j in range(len(compliance)):
        out[0, j] = max(factors[j], gap.least) * compliance[j]
        out[1, j] = max(sizes[5, j] + sizes[6, j], gap.half)
    return out


@compiled
def step(springs, gap, torque, duration, is_first, state):
    """Loads gears for a time; see `GearErrors.step`.

    Args:
        springs: their compliance in rad per N m and half of their play in rad, (2, n).
        gap: `Gap`.
        torque: of the gears, N m, (n,), for the duration in s.
        is_first: whether nothing is known of what was before.
        state: (4, n): deflection of spring and gap together in rad, that of the hysteresis in shares of its
            width, and where the teeth are in an open gap and in one that is held; is renewed.
    """
    for j in range(len(torque)):
        compliance, half = springs[0, j], springs[1, j]
        held = gap.held / compliance  # N m/rad
        if is_first:
            side = -1.0 if torque[j] > 0.0 else 1.0 if torque[j] < 0.0 else 0.0
            state[1, j], state[2, j], state[3, j] = 0.0, side, side
            state[0, j] = half * side - compliance * torque[j]
            continue
        pace = duration / (gap.grease * half)  # per N m
        free = state[2, j] - pace * torque[j]
        state[2, j] = min(max(free, -1.0), 1.0)
        # Implicit in the spring of the hysteresis, which goes along with the teeth.
        z, teeth, spring = gap.width * state[1, j], state[3, j], held * half
        push = torque[j] + held * z - spring * teeth
        way = (teeth - pace * push) / (1.0 + pace * spring)
        state[3, j] = min(max(way, -1.0), 1.0)
        deflection = half * state[3, j] - compliance * (torque[j] + held * z)
        turn = deflection - state[0, j]
        end = 1.0 if turn > 0.0 else -1.0
        state[0, j] = deflection
        state[1, j] = end + (state[1, j] - end) * math.exp(-abs(turn) / gap.width)


@compiled
def shapes(turns, states, out):
    """Sine and cosine of one and two turns of motors at angles in rad (n,), then the states; (7, n)."""
    for j in range(len(turns)):
        sine, cosine = math.sin(turns[j]), math.cos(turns[j])
        out[0, j], out[1, j] = sine, cosine
        out[2, j], out[3, j] = 2.0 * sine * cosine, cosine * cosine - sine * sine
        for k in range(3):
            out[4 + k, j] = states[len(turns) * k + j]
