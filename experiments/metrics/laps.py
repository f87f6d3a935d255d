"""The error of each lap of a run that goes along its path several times."""

import math
from typing import Any

import numpy as np

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import pose_errors


def lap_metrics(log: RunLog, source: str) -> list[dict[str, float]]:
    """Largest and root mean square errors of each lap, from its start to that of the next one.

    The last lap ends where the dwell begins. A run without laps has one. ``source`` is "true" or "measured";
    a number without a single sample is NaN.
    """
    starts = log.lap_starts or (log.path_start,)
    e = pose_errors(log, source)
    valid = np.isfinite(e).all(axis=1)
    laps = []
    for start, end in zip(starts, (*starts[1:], log.dwell_start), strict=True):
        lap = e[valid & (log.time >= start - 1e-9) & (log.time < end - 1e-9)]
        laps.append(_errors(lap))
    return laps


def _errors(e: np.ndarray) -> dict[str, Any]:
    """Of errors (n, 6) in rad and m."""
    if not len(e):
        return dict.fromkeys(("max_norm_mm", "max_angle_deg", "rms_mm"), math.nan)
    distance, angle = np.linalg.norm(e[:, 3:], axis=1), np.linalg.norm(e[:, :3], axis=1)
    return {
        "max_norm_mm": 1e3 * float(distance.max()),
        "max_angle_deg": math.degrees(float(angle.max())),
        "rms_mm": 1e3 * math.sqrt(float(np.mean(distance**2))),
    }
