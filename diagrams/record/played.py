"""What a record says of the path that was run: its marks, and what was measured along it."""

from typing import Any

import numpy as np

from systems.reference.paths import CartesianPath
from systems.reference.played_path import PlayedPath


def played(path: CartesianPath, times: np.ndarray, data: dict[str, np.ndarray]) -> CartesianPath | PlayedPath:
    """The path as it was run, from what `PackedLog.read` gives."""
    return PlayedPath(path, times, data["path_time"]) if "path_time" in data and len(times) else path


def path_marks(path: CartesianPath | PlayedPath) -> dict[str, Any]:
    """The times of a `RunLog` that a path sets, and the time on the path where it was slowed."""
    starts = path.lap_starts.tolist()
    return {
        "path_start": path.path_start,
        "dwell_start": path.dwell_start,
        "path_end": path.duration,
        "lap_starts": tuple(starts) if len(starts) > 1 else (),
        "path_time": path.path_time if isinstance(path, PlayedPath) and path.is_slowed else None,
    }


def measured_along(
    path: CartesianPath | PlayedPath, times: np.ndarray, exposure_times: np.ndarray, X_WE: np.ndarray
) -> np.ndarray:
    """Measured poses at the times of a log, NaN where there is none, shape (n, 4, 4).

    A pose that was exposed between two times of the log is carried along the path to the nearest one, so
    that its difference from the wanted pose stays what it was.
    """
    poses = np.full((len(times), 4, 4), np.nan)
    if not len(times) or not len(exposure_times):
        return poses
    half = 0.5 * float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    nearest = np.clip(np.searchsorted(times, exposure_times - half - 1e-9), 0, len(times) - 1)
    kept = np.abs(times[nearest] - exposure_times) <= half + 1e-9
    wanted_then, wanted_now = path.sample(exposure_times[kept])[0], path.sample(times[nearest[kept]])[0]
    seen, now = X_WE[kept], nearest[kept]
    is_same = np.abs(times[now] - exposure_times[kept]) < 1e-9
    shift = wanted_now[:, :3, :3] @ wanted_then[:, :3, :3].swapaxes(1, 2)
    poses[now] = seen
    moved = now[~is_same]
    poses[moved, :3, :3] = (shift @ seen[:, :3, :3])[~is_same]
    poses[moved, :3, 3] = (seen[:, :3, 3] + wanted_now[:, :3, 3] - wanted_then[:, :3, 3])[~is_same]
    return poses
