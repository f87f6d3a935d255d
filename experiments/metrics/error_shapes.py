"""The error of a run seen from several sides: across and along the path, over its length, over frequency."""

from dataclasses import dataclass

import numpy as np

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import judged_source, path_window, pose_errors

_LEAST_STEP = 1e-9  # m between two samples; below it the path stands still and has no direction of its own
_SHARE = 0.5  # of a run that one of the three overlapping pieces has, over which a spectrum is a mean


@dataclass(frozen=True)
class PathErrors:
    """Errors of the position on the path, n samples where a pose is known.

    Attributes:
        time: s, shape (n,).
        length: way along the wanted path since its start in m, shape (n,).
        distance: of the tip from the wanted point in m, shape (n,).
        lag: how far the tip is behind along the tangent of the path in m, shape (n,); negative if ahead.
        contour: distance of the tip from the tangent in m, shape (n,).
    """

    time: np.ndarray
    length: np.ndarray
    distance: np.ndarray
    lag: np.ndarray
    contour: np.ndarray


def path_errors(log: RunLog) -> PathErrors:
    """Splits e = wanted - attained into a part along the path, the lag, and the rest, the contour error.

    The two are exact for a straight path; on a curved one they are those of its tangent. Where the path
    stands still, it keeps the last direction that it had.
    """
    on_path = path_window(log)
    p_WD = log.X_WE_desired[on_path, :3, 3]
    error = pose_errors(log, judged_source(log))[on_path, 3:]
    step = np.diff(p_WD, axis=0, prepend=p_WD[:1])
    length = np.cumsum(np.linalg.norm(step, axis=1))
    along = np.einsum("ij,ij->i", error, _tangents(p_WD))
    across = np.sqrt(np.maximum(np.sum(error**2, axis=1) - along**2, 0.0))
    known = np.isfinite(error).all(axis=1)
    distance = np.linalg.norm(error, axis=1)
    columns = (log.time[on_path], length, distance, along, across)
    return PathErrors(*(column[known] for column in columns))


def _tangents(p: np.ndarray) -> np.ndarray:
    """Unit vectors along positions (n, 3), the last known one where they stand still."""
    if len(p) < 2:
        return np.zeros_like(p)
    direction = np.gradient(p, axis=0)
    size = np.linalg.norm(direction, axis=1)
    moving = np.flatnonzero(size > _LEAST_STEP)
    if len(moving) == 0:
        return np.zeros_like(p)
    before = np.maximum(np.searchsorted(moving, np.arange(len(p)), side="right") - 1, 0)
    chosen = moving[before]
    return direction[chosen] / size[chosen, None]


def error_spectrum(log: RunLog) -> tuple[np.ndarray, np.ndarray]:
    """Which frequencies the error of the position holds while the path runs and rests.

    Returns:
        Frequencies in Hz and the amplitude density in m / sqrt(Hz), the root of the sum over the three axes
        of what Welch's method gives; both (n,), without the mean. Empty for fewer than 64 known samples.
    """
    from scipy.signal import welch  # here: half a second that few need

    on_path = path_window(log)
    error = pose_errors(log, judged_source(log))[on_path, 3:]
    known = np.isfinite(error).all(axis=1)
    if known.sum() < 64:
        return np.empty(0), np.empty(0)
    time = log.time[on_path]
    period = float(np.median(np.diff(time)))
    # Of the record of a station there is a row for each exposure alone: some are missing.
    evenly = time[0] + period * np.arange(round((time[-1] - time[0]) / period) + 1)
    filled = np.stack([np.interp(evenly, time[known], error[known, axis]) for axis in range(3)], -1)
    frequency, density = welch(filled, 1.0 / period, nperseg=int(_SHARE * len(filled)), axis=0)
    return frequency[1:], np.sqrt(density.sum(axis=1))[1:]


def camera_errors(log: RunLog) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far the measured pose is from the true one.

    Returns:
        Times in s, distances in m and angles in rad of the samples where both are known, shape (n,) each.
    """
    difference = pose_errors(log, "measured") - pose_errors(log, "true")
    known = np.isfinite(difference).all(axis=1)
    found = difference[known]
    return log.time[known], np.linalg.norm(found[:, 3:], axis=1), np.linalg.norm(found[:, :3], axis=1)
