"""What samples say beyond the estimate: their running mean, the last of them, and how they scatter."""

import math

import numpy as np

from robots.compiled import compiled


@compiled
def largest(r, variances):
    """The largest entry of an error (6,) in standard deviations."""
    most = 0.0
    for i in range(len(r)):
        most = max(most, abs(r[i]) / math.sqrt(variances[i]))
    return most


@compiled
def enter(r, by_model, number, share, variances, error, spread, recent, by_model_then):
    """Takes one innovation in, as if it had come ``number`` times; returns the largest mean in sigmas.

    Args:
        r: (6,); by_model: what the estimate may be wrong by, in variances of the camera, (6,).
        share: of it in the mean.
        variances: of the camera, (6,).
        error, spread: running means of r, and of what the estimate may be wrong by in sigmas, (6,);
        recent, by_model_then: the last r and by_model, the newest one last, (n, 6); all are renewed.
    """
    n = len(recent)
    kept = max(0, n - number)
    most = 0.0
    for i in range(6):
        for k in range(kept):
            recent[k, i], by_model_then[k, i] = recent[k + number, i], by_model_then[k + number, i]
        for k in range(kept, n):
            recent[k, i], by_model_then[k, i] = r[i], by_model[i]
        error[i] += share * (r[i] - error[i])
        spread[i] += share * (math.sqrt(by_model[i]) - spread[i])
        most = max(most, abs(error[i]) / math.sqrt(variances[i]))
    return most


@compiled
def enter_usual(r, variances, suspicious, share, error, spread, recent, by_model_then):
    """`enter` of one innovation that needs no explanation; -1 and nothing else if it does.

    Args:
        r, share, variances, error, spread, recent, by_model_then: as of `enter`.
        suspicious: how many standard deviations need one.
    """
    if largest(r, variances) > suspicious:
        return -1.0
    return enter(r, np.zeros(6), 1, share, variances, error, spread, recent, by_model_then)


@compiled
def scatter(r, last, variance, believed, most, share):
    """Takes half of the square of a change, (6,), into a mean; r becomes the last one.

    It counts as at most so many times the mean: a robot that is upset is no noise of the camera.
    """
    for i in range(len(r)):
        square = min(0.5 * (r[i] - last[i]) ** 2, most * max(variance[i], believed[i]))
        variance[i] += share * (square - variance[i])
        last[i] = r[i]


@compiled
def bend(r, H, xi, twist, time, believed, limits, last, times, held, variance, changes):
    """Takes a sixth of the square of a second difference of r + H xi, (6,), into a mean.

    Args:
        r, H, xi: error (6,), its columns (6, n) and the estimate (n,).
        twist: of the tip, (6,); time: of the sample in s.
        believed: variances, (6,).
        limits: m and rad that the tip may go from sample to sample; the most by which a square counts, in
            times the mean or what is believed; how many samples are in the mean.
        last, times: the last errors, (2, 6), and times in s, (2,), newest first; held: how many, (1,).
        variance: (6,), changes: how many are in it, (1,); both are renewed, as the last ones are.
    """
    near, most, window = limits
    y, step = r.copy(), time - times[0]
    for i in range(6):
        for k in range(len(xi)):
            y[i] += H[i, k] * xi[k]
    turn = shift = 0.0
    for i in range(3):
        turn += twist[i] ** 2
        shift += twist[3 + i] ** 2
    if shift * step**2 > near[0] ** 2 or turn * step**2 > near[1] ** 2:
        held[0] = 0.0
    if held[0] >= 2.0 and abs(step - (times[0] - times[1])) < 0.2 * step:
        changes[0] += 1.0
        share = 1.0 / min(changes[0], window)
        for i in range(6):
            square = (y[i] - 2.0 * last[0, i] + last[1, i]) ** 2 / 6.0
            square = min(square, most * max(variance[i], believed[i]))
            variance[i] += share * (square - variance[i])
    for i in range(6):
        last[1, i], last[0, i] = last[0, i], y[i]
    times[1], times[0] = times[0], time
    held[0] += 1.0
