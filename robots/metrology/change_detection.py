"""Changes in a stream of residuals: cumulative sums for sudden ones, exponential averages for slow ones.

Both take residuals in units of their standard deviations. A cumulative sum (CUSUM, Page 1954) adds what
exceeds a drift and begins anew at zero; where it passes a threshold, the last time it was zero is the onset.
"""

from dataclasses import dataclass

import numpy as np

DRIFT = 0.5  # standard deviations: half of the smallest change that is looked for
THRESHOLD = 25.0  # so high that white noise passes it once in exp(2 drift threshold) = 7e10 samples


@dataclass(frozen=True)
class Change:
    """A change of the mean of one channel."""

    channel: int
    at: int  # the sample at which it was known
    onset: int  # the sample at which it began
    size: float  # standard deviations, with its sign
    sigma: float  # of the size


def cusum_changes(residuals: np.ndarray, drift: float = DRIFT, threshold: float = THRESHOLD) -> list[Change]:
    """The first change of each channel, the earliest known first.

    Args:
        residuals: in standard deviations, shape (n, channels); NaN where there is none.
        drift: in standard deviations.
        threshold: of the sums, likewise.
    """
    values, found = np.nan_to_num(residuals), []
    for channel in range(values.shape[1]):
        first: tuple[int, int] | None = None
        for sign in (1.0, -1.0):
            total = np.cumsum(sign * values[:, channel] - drift)
            lowest = np.minimum(np.minimum.accumulate(total), 0.0)
            above = np.flatnonzero(total - lowest > threshold)
            if len(above) and (first is None or above[0] < first[0]):
                at = int(above[0])
                zero = np.flatnonzero(total[: at + 1] <= lowest[: at + 1])
                first = at, int(zero[-1]) + 1 if len(zero) else 0
        if first is not None:
            at, onset = first
            since = values[onset : at + 1, channel]
            found.append(Change(channel, at, onset, float(since.mean()), 1.0 / np.sqrt(len(since))))
    return sorted(found, key=lambda change: change.at)


def ewma(values: np.ndarray, weight: float) -> tuple[np.ndarray, np.ndarray]:
    """Exponentially weighted means of rows, and their variances for rows of unit variance.

    Args:
        values: shape (n, ...), the oldest first.
        weight: of the newest row, above 0 and at most 1.

    Returns:
        Means of the same shape, and variances (n,): weight / (2 - weight) (1 - (1 - weight)^(2 n)).

    Raises:
        ValueError: if the weight is not in its range.
    """
    if not 0.0 < weight <= 1.0:
        raise ValueError(f"ewma: weight must be above 0 and at most 1, got {weight}")
    mean, means = np.zeros(values.shape[1:]), []
    for row in values:
        mean = mean + weight * (row - mean)
        means.append(mean)
    steps = np.arange(1, len(values) + 1)
    variance = weight / (2.0 - weight) * (1.0 - (1.0 - weight) ** (2 * steps))
    return np.array(means).reshape(values.shape), variance
