"""How often the true tip is where a law that predicts it, with a covariance, says that it is."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import chdtri

from robots.pose import pose_error

Prediction = tuple[float, np.ndarray, np.ndarray]  # time in s, tip (4, 4), covariance (6, 6), rotation first

_SHARE = 0.95
_APART = 1e-3  # s, by which a prediction may miss a time of the log


def coverage(predictions: Sequence[Prediction], times: np.ndarray, X_WE: np.ndarray) -> dict[str, Any]:
    """The share of predictions whose ellipsoid of 95 % holds the true tip.

    Args:
        predictions: of the tip.
        times: s, (n,), when the tip is known.
        X_WE: true tip then, (n, 4, 4).

    Returns:
        ``share``, 0.95 where the law knows how well it knows the tip, None where nothing was compared; and
        ``samples``, how many were.
    """
    inside = []
    for time, predicted, covariance in predictions:
        row = int(np.argmin(np.abs(times - time))) if len(times) else 0
        if not len(times) or abs(times[row] - time) > _APART:
            continue
        error = pose_error(X_WE[row], predicted)
        inside.append(error @ np.linalg.solve(covariance, error) < chdtri(6, 1.0 - _SHARE))
    return {"share": float(np.mean(inside)) if inside else None, "samples": len(inside)}
