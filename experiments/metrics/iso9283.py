"""Accuracy and repeatability of poses and paths over several cycles, after ISO 9283.

ISO 9283 compares paths as curves: being late along the path is no path error. The distance of an attained
position is therefore taken to the nearest point of the commanded polyline, looked for within half a second
of the position's time, so that a path which crosses itself is not mistaken for its other branch.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from diagrams.record.log import RunLog
from robots.pose import pose_error

SEARCH_WINDOW = 0.5  # s, on both sides
POSE_WINDOW = 0.5  # s, the attained pose is the mean over the end of the dwell


def iso_9283(cycles: Sequence[RunLog], source: str) -> dict[str, Any]:
    """Pose and path accuracy (AP, AT) and repeatability (RP, RT) of the cycles of one law.

    - AP: distance of the barycentre of the attained end poses from the commanded one; ``AP_deg`` is the
      angle of the mean rotation vector.
    - RP: mean distance of the attained end positions from their barycentre plus three standard deviations.
    - AT: largest distance of the path of the barycentres from the commanded path as a curve.
    - RT: largest such radius as of RP over the path, cycles compared at the same time, or where the path was
      slowed, at the same time of the path. The standard looks only across the path; this radius also holds
      the scatter along it and is never smaller.

    Repeatability is None for a single cycle. ``source`` is "true" or "measured"; where a cycle has no
    measurement the time is left out for all of them. A cycle that a station broke off counts among
    ``cycles``, and in nothing else as long as another one came to its end.
    """
    whole = [log for log in cycles if not log.ended_early] or cycles[:1]
    first = whole[0]
    time, X_WE_desired, X = _in_step(whole, source)
    path_start, dwell_start, path_end = np.interp(
        (first.path_start, first.dwell_start, first.path_end), first.time, _on_path(first)
    )
    slack = 0.25 * float(time[1] - time[0]) if len(time) > 1 else 0.0
    on_path = (time >= path_start - slack) & (time <= path_end + slack)
    usable = on_path & np.isfinite(X).all(axis=(0, 2, 3))
    at_end = usable & (time >= max(dwell_start, path_end - POSE_WINDOW) - slack)
    result: dict[str, Any] = dict.fromkeys(("AP_mm", "RP_mm", "AT_mm", "RT_mm", "AP_deg"))
    result["cycles"] = len(cycles)
    if at_end.any():
        e = pose_error(X_WE_desired[at_end], X[:, at_end]).mean(axis=1)
        result["AP_mm"] = 1e3 * float(np.linalg.norm(e[:, 3:].mean(axis=0)))
        result["AP_deg"] = float(np.rad2deg(np.linalg.norm(e[:, :3].mean(axis=0))))
        if len(whole) > 1:
            result["RP_mm"] = 1e3 * float(repeatability(e[:, 3:]))
    if usable.any():
        p = X[:, usable][..., :3, 3]
        distances = path_distance(time[usable], p.mean(axis=0), time[on_path], X_WE_desired[on_path, :3, 3])
        result["AT_mm"] = 1e3 * float(distances.max())
        if len(whole) > 1:
            result["RT_mm"] = 1e3 * float(repeatability(p).max())
    return result


def _on_path(log: RunLog) -> np.ndarray:
    """The time on the path in s at the times of a log, (n,)."""
    return log.time if log.path_time is None else log.path_time


def _in_step(cycles: Sequence[RunLog], source: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times on the path in s, (n,), wanted poses then, (n, 4, 4), and those of the cycles, (cycles, n, 4, 4).

    A cycle that was slowed or interrupted came to a place at another time, between two samples perhaps: it is
    off the first cycle's wanted pose by what it was off its own at its next sample.
    """
    first = cycles[0]
    poses = [log.X_WE_true if source == "true" else log.X_WE_measured for log in cycles]
    if all(log.path_time is None and np.array_equal(log.time, first.time) for log in cycles):
        return first.time, first.X_WE_desired, np.stack(poses)
    period = float(np.median(np.diff(first.time)))
    times = np.arange(_on_path(first)[0], min(_on_path(log)[-1] for log in cycles) + 0.5 * period, period)
    rows = [np.searchsorted(_on_path(log), times - 1e-9) for log in cycles]
    rows = [np.minimum(row, len(log.time) - 1) for row, log in zip(rows, cycles, strict=True)]
    wanted = first.X_WE_desired[rows[0]]
    carried = []
    for log, row, X in zip(cycles, rows, poses, strict=True):
        own, moved = log.X_WE_desired[row], X[row]
        turn = wanted[:, :3, :3] @ own[:, :3, :3].swapaxes(1, 2)
        moved[:, :3, :3] = turn @ moved[:, :3, :3]
        moved[:, :3, 3] += wanted[:, :3, 3] - own[:, :3, 3]
        carried.append(moved)
    return times, wanted, np.stack(carried)


def repeatability(p: np.ndarray) -> np.ndarray:
    """Mean distance from the barycentre plus three standard deviations of that distance.

    Args:
        p: positions of the cycles, shape (cycles >= 2, ..., 3), m.

    Returns:
        Radii in m, shape (...).
    """
    radius = np.linalg.norm(p - p.mean(axis=0), axis=-1)
    return radius.mean(axis=0) + 3.0 * radius.std(axis=0, ddof=1)


def path_distance(
    time: np.ndarray, p: np.ndarray, path_time: np.ndarray, path: np.ndarray, search: float = SEARCH_WINDOW
) -> np.ndarray:
    """Distance of positions from a polyline, to the segments within ``search`` seconds of each.

    Args:
        time: of the positions in s, shape (n,).
        p: positions in m, shape (n, 3).
        path_time: of the corners of the polyline in s, increasing, shape (m,).
        path: corners in m, shape (m, 3).
        search: how far to look, s.

    Returns:
        Distances in m, shape (n,).
    """
    if len(path) == 1:
        return np.linalg.norm(p - path[0], axis=1)
    segment = np.diff(path, axis=0)
    length_squared = np.maximum(np.einsum("ij,ij->i", segment, segment), np.finfo(float).tiny)
    nearest = np.clip(np.searchsorted(path_time, time, side="right") - 1, 0, len(segment) - 1)
    reach = int(np.ceil(search / np.median(np.diff(path_time))))
    best = np.full(len(p), np.inf)
    for offset in range(-reach, reach + 1):
        i = np.clip(nearest + offset, 0, len(segment) - 1)
        from_corner = p - path[i]
        along = np.clip(np.einsum("ij,ij->i", from_corner, segment[i]) / length_squared[i], 0.0, 1.0)
        rest = from_corner - along[:, None] * segment[i]
        np.minimum(best, np.einsum("ij,ij->i", rest, rest), out=best)
    return np.sqrt(best)
