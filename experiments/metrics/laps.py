"""The error of each lap of a run that goes along its path several times, and how long it took."""

import math
from typing import Any

import numpy as np

from diagrams.record.log import RunLog

SLOWED = 1.005  # times the planned time, from which on tables say how long a lap took


def lap_metrics(log: RunLog, e: np.ndarray) -> list[dict[str, float]]:
    """Largest and root mean square errors of each lap, from its start to that of the next one.

    The last lap ends where the dwell begins; a run without laps has one.

    Args:
        log: of the run, n samples.
        e: its errors, rotation first, in rad and m, (n, 6); NaN where there is none.

    Returns:
        Per lap ``max_norm_mm``, ``max_angle_deg`` and ``rms_mm``, NaN without a single sample; ``duration_s``
        and ``times_planned``, over how long it was to take: more than 1 where the law went more slowly.
    """
    starts = log.lap_starts or (log.path_start,)
    valid = np.isfinite(e).all(axis=1)
    laps = []
    for start, end in zip(starts, (*starts[1:], log.dwell_start), strict=True):
        lap = e[valid & (log.time >= start - 1e-9) & (log.time < end - 1e-9)]
        laps.append(_errors(lap) | _duration(log, start, end))
    return laps


def times_planned(log: RunLog, start: float, end: float) -> float:
    """How many times as long as planned a run took for its path between two times in s.

    NaN where it did not come any further on it.
    """
    on_path = log.time if log.path_time is None else log.path_time
    first, last = np.interp((start, end), log.time, on_path)
    return (end - start) / float(last - first) if last > first else math.nan


def _duration(log: RunLog, start: float, end: float) -> dict[str, float]:
    """Of a lap between two times in s."""
    return {"duration_s": end - start, "times_planned": times_planned(log, start, end)}


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
