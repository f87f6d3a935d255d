"""By how much two recordings of one motion are apart in time, found in the signals themselves.

Cross-correlation, Reiner (2010) eq. (4.3), corrected: for m < 0 it is R_yx(-m), not R_xy(-m). Its maximum is
searched for between the samples, too.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

_LEAST_CORRELATION = 0.5  # of the two signals where they fit best: below, they are not of one motion


class AlignmentError(ValueError):
    """Two signals that cannot be brought to one time."""


@dataclass(frozen=True)
class Alignment:
    """How two signals fit."""

    lag: float  # s, by which the second one is later than the first
    correlation: float  # of the two there, from -1 to 1


@dataclass(frozen=True)
class ClockModel:
    """What another clock shows: ``stamp = time * (1 + 1e-6 drift_ppm) + offset``."""

    offset: float  # s
    drift_ppm: float

    def time(self, stamp: np.ndarray) -> np.ndarray:
        """The time in s at which that clock has shown its stamps in s; any shape."""
        return (np.asarray(stamp) - self.offset) / (1.0 + 1e-6 * self.drift_ppm)


def align(first: np.ndarray, second: np.ndarray, period: float, window: float) -> Alignment:
    """Finds the lag between two signals with the same sampling.

    To a fraction of a sample: around the lag where the sum of products is largest, the correlation is
    maximised with the second signal interpolated by a cubic spline.

    Args:
        first, second: shape (n,) or (n, channels) with the same shape; channels are summed up.
        period: between samples in s.
        window: the largest lag in s that may be.

    Raises:
        AlignmentError: if a signal does not change, the best lag is at an end of the window or the signals
            have little in common there.
    """
    from scipy.signal import correlate  # here: half a second that few need

    x, y = (np.asarray(signal, dtype=float).reshape(len(signal), -1) for signal in (first, second))
    if x.shape != y.shape:
        raise AlignmentError(f"signals must have the same shape, got {x.shape} and {y.shape}")
    x, y = x - x.mean(0), y - y.mean(0)
    norm = float(np.sqrt(np.sum(x * x) * np.sum(y * y)))
    if not norm > 0.0:
        raise AlignmentError("a signal that does not change has no time")
    # R_yx(m) = sum_n y(n + m) x(n): largest where y is m samples later.
    product = np.sum([correlate(y[:, k], x[:, k]) for k in range(x.shape[1])], axis=0)
    lags = np.arange(1 - len(x), len(x))
    inside = np.flatnonzero(np.abs(lags) <= window / period)
    best = inside[int(np.argmax(product[inside]))]
    correlation = float(product[best]) / norm
    if best in (inside[0], inside[-1]) or correlation < _LEAST_CORRELATION:
        raise AlignmentError(
            f"no lag within +-{window:g} s at which the signals fit: the best one is "
            f"{lags[best] * period:g} s with a correlation of {correlation:.2f}"
        )
    # The sum of products has less and less to sum at larger lags, which draws its maximum towards zero; the
    # correlation of what both have does not.
    edge = abs(int(lags[best])) + 2
    times, inner = np.arange(len(x)), slice(edge, len(x) - edge)
    later = CubicSpline(times, y)

    def misfit(lag: float) -> float:
        return -_correlation(x[inner], later(times[inner] + lag))

    found = minimize_scalar(
        misfit, bounds=(lags[best] - 1.5, lags[best] + 1.5), method="bounded", options={"xatol": 1e-5}
    )
    return Alignment(float(found.x) * period, -float(found.fun))


def _correlation(x: np.ndarray, y: np.ndarray) -> float:
    """Of all channels together, free of their means."""
    x, y = x - x.mean(0), y - y.mean(0)
    return float(np.sum(x * y) / np.sqrt(np.sum(x * x) * np.sum(y * y)))


def clock_model(times: np.ndarray, lags: np.ndarray) -> ClockModel:
    """The offset and drift of a clock from lags that were found at several times.

    Args:
        times: by the reference clock in s, shape (n,).
        lags: how far the stamps were ahead then in s, shape (n,).
    """
    times, lags = np.asarray(times, dtype=float), np.asarray(lags, dtype=float)
    if len(times) < 2 or np.ptp(times) == 0.0:
        return ClockModel(float(lags.mean()), 0.0)
    drift, offset = np.polyfit(times, lags, 1)
    return ClockModel(float(offset), 1e6 * float(drift))
