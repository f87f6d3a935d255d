"""One case of driven motors and the arm behind them, step by step, as a loop that numba compiles."""

import numpy as np

from robots.compiled import compiled
from robots.identification.motion import BETA, GAMMA
from robots.identification.response_kernels import accelerate, between, place_of

_GEARS = 6
_PASSES = 3  # a motor turns so little in a step that each pass gains two digits


@compiled
def _friction(parts, speed):
    """Of a motor in N m; viscous, Coulomb, steepness, hump, speed of the hump: drive_parts.Stribeck."""
    viscous, coulomb, steepness, hump, at = parts
    smooth = viscous * speed + coulomb * np.tanh(0.5 * steepness * speed)
    return smooth + 2.0 * hump * at * speed / (speed * speed + at * at)


@compiled
def drive_through(h, in_sample, posture, load, ripple, springs, gears, start, drive, friction, moved, torque):
    """Goes through one case; e sprung joints and then six motors, which is E; k knots, N steps.

    Motors are where they were measured to be and a little beyond: the last six coordinates.

    Args:
        h: step in s.
        in_sample: steps in a sample of the case.
        posture: steps of the knots, (k,); stiffness and Coriolis terms, (k, E, 2 E); turns at rest,
            (k, 1, E); steps at which the inverse of mass, damping and stiffness of a step is known, (f,),
            and that, (f, E, E).
        load: torque in N m that the measured motion needs, (N, E).
        ripple: of the gears and its rate, (N, 2, 6).
        springs: springs and dampers, zero for motors, (2, E).
        gears: see `response_kernels.gear_step`, (6, 6).
        start: deflections, (E,).
        drive: torque in N m that the controllers give where the motors are as measured, (N, 6); gains by
            position, integral and speed, (3, 6); lag of the motors in s, (6,); their torque at first, (6,).
        friction: speeds of the motors as measured in rad/s, (N, 6), and parts, (6, 5).
        moved: coordinates, their rates and accelerations at the samples, (samples, 3 E); written.
        torque: that the motors are told to give, (samples, 6); written.
    """
    at, motion, rest, close, inverse = posture
    told, gains, lag, first = drive
    speeds, parts = friction
    E = springs.shape[1]
    e = E - _GEARS
    x, v, a = start.copy(), np.zeros(E), np.zeros(E)
    turn, z = x[:_GEARS] - ripple[0, 0], np.zeros(_GEARS)
    integral, late, given = np.zeros(_GEARS), first.copy(), first.copy()
    S, motion_now, rest_now = np.empty((E, E)), np.empty((E, 2 * E)), np.empty((1, E))
    found, place = np.zeros((_GEARS, 10)), np.empty(2 * E)
    outer, free = np.empty(_GEARS), np.empty(E)
    knot, last = 0, 0
    for step in range(len(load)):
        knot, share = place_of(at, knot, step)
        if step:
            last, gone = place_of(close, last, step)
            between(inverse, last, gone, S)
            between(motion, knot, share, motion_now)
            between(rest, knot, share, rest_now)
            for j in range(E):
                place[j] = x[j] + h * v[j] + (0.5 - BETA) * h * h * a[j]
                place[E + j] = v[j] + (1.0 - GAMMA) * h * a[j]
            x_p, v_p = place[:E].copy(), place[E:].copy()
            place[:E] -= rest_now[0]
            inner = -load[step] - springs[0] * x_p - springs[1] * v_p - np.dot(motion_now, place)
            inside = np.dot(S, inner)
            before = integral.copy()
            late_before, x_before = late.copy(), x[e:].copy()
            for _ in range(_PASSES):
                for j in range(_GEARS):
                    beyond = x_p[e + j] + BETA * h * h * a[e + j]
                    rate = v_p[e + j] + GAMMA * h * a[e + j]
                    integral[j] = before[j] - 0.5 * h * (x_before[j] + beyond)
                    given[j] = told[step, j] - gains[0, j] * beyond - gains[2, j] * rate
                    given[j] += gains[1, j] * integral[j]
                    # Backwards, which is right without a lag too.
                    late[j] = (lag[j] * late_before[j] + h * given[j]) / (lag[j] + h)
                    outer[j] = late[j] - _friction(parts[j], speeds[step, j] + rate)
                # Drives and friction turn the motors alone.
                for i in range(E):
                    free[i] = inside[i]
                    for j in range(_GEARS):
                        free[i] += S[i, e + j] * outer[j]
                accelerate(a, free, S, gears, turn, z, ripple[step], springs, x_p, v_p, h, found)
            for j in range(E):
                x[j], v[j] = x_p[j] + BETA * h * h * a[j], v_p[j] + GAMMA * h * a[j]
            for j in range(_GEARS):
                turn[j], z[j] = x[j] - ripple[step, 0, j], found[j, 1]
        if step % in_sample == 0:
            row = step // in_sample
            moved[row, :E], moved[row, E : 2 * E], moved[row, 2 * E :] = x, v, a
            torque[row] = given
