"""What is left of measured motions when commands are shifted in time."""

import math

import numpy as np

from robots.compiled import compiled
from systems.estimation.kernels.history import around, between


@compiled
def misfits(measured, commanded, number, period, is_working, least, squares):
    """Compares what encoders said last with commands that are later and later; see `DeadTime.search`.

    Args:
        measured, commanded: `Ring` of positions in rad, (6,).
        number: how many instants are compared; so many were measured at least.
        period: s, of the shifts.
        is_working: positions are compared as they are, otherwise less their means.
        least: rad, root of the mean square of the joint that moves most.
        squares: (m,), share of the motion that each shift leaves, from none on; is written.

    Returns:
        Whether a joint moves as much as that; if not, nothing has been written.
    """
    shifts, held = len(squares), int(measured.count[0])
    newest = measured.times[(held - 1) % len(measured.times)]
    oldest = measured.times[(held - number) % len(measured.times)]
    actual, wanted = np.empty((number, 6)), np.empty((number + shifts - 1, 6))
    mean, motion, largest = np.zeros(6), 0.0, 0.0
    for i in range(number):
        time = max(oldest, newest - (number - 1 - i) * period)
        before, behind, share = around(held, measured.times, time)
        between(measured.rows, before, behind, share, actual[i])
        for k in range(6):
            mean[k] += actual[i, k] / number
    for k in range(6):
        square = 0.0
        for i in range(number):
            actual[i, k] -= mean[k]
            square += actual[i, k] ** 2
        motion += square
        largest = max(largest, math.sqrt(square / number))
    if largest < least:
        return False
    count = int(commanded.count[0])
    for i in range(len(wanted)):
        time = newest - (len(wanted) - 1 - i) * period
        before, behind, share = around(count, commanded.times, time)
        between(commanded.rows, before, behind, share, wanted[i])
        for k in range(6):
            wanted[i, k] -= mean[k]
    for shift in range(shifts):
        first, left = shifts - 1 - shift, 0.0
        for k in range(6):
            mean[k] = 0.0
        if not is_working:
            for i in range(number):
                for k in range(6):
                    mean[k] += wanted[first + i, k] / number
        for i in range(number):
            for k in range(6):
                left += (wanted[first + i, k] - mean[k] - actual[i, k]) ** 2
        squares[shift] = left / motion
    return True
