"""How often the true tip is where a law that predicts it, with a covariance, says that it is."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import chdtri

from robots.pose import pose_error

Prediction = tuple[float, np.ndarray, np.ndarray]  # time in s, tip (4, 4), covariance (6, 6), rotation first

_SHARE = 0.95
_GAP = 0.02  # s, between two times of the log, over which the motion of a robot is still a cubic


def coverage(predictions: Sequence[Prediction], times: np.ndarray, X_WE: np.ndarray) -> dict[str, Any]:
    """The share of predictions whose ellipsoid of 95 % holds the true tip.

    A robot at 0.5 m/s is 0.5 mm away a millisecond later, many times what the ellipsoid allows. So the tip
    is compared at the very time of a prediction, between two times of the log on a cubic spline through it.

    Args:
        predictions: of the tip; those outside the times of the log, or in a gap of it, are left out.
        times: s, increasing, (n,), when the tip is known.
        X_WE: true tip then, (n, 4, 4).

    Returns:
        ``share``, 0.95 where the law knows how well it knows the tip, None where nothing was compared; and
        ``samples``, how many were.
    """
    compared = [each for each in predictions if _is_covered(times, each[0])]
    if not compared:
        return {"share": None, "samples": 0}
    truth = CubicSpline(times, X_WE)(np.array([time for time, _, _ in compared]))
    inside = []
    for true, (_, predicted, covariance) in zip(truth, compared, strict=True):
        error = pose_error(true, predicted)
        inside.append(error @ np.linalg.solve(covariance, error) < chdtri(6, 1.0 - _SHARE))
    return {"share": float(np.mean(inside)), "samples": len(inside)}


def _is_covered(times: np.ndarray, time: float) -> bool:
    """Whether a time is one of the log, or between two that are close together."""
    if len(times) < 2 or not times[0] <= time <= times[-1]:
        return False
    after = max(int(np.searchsorted(times, time)), 1)
    return bool(times[after] == time or times[after] - times[after - 1] < _GAP)
