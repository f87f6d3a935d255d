"""The motion of a replay: for each law joints, gears and tip at the frames, errors beside them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import known_poses, path_window
from experiments.report.curves import coded, rounded
from experiments.report.style import law_colors, law_title
from robots.pose import pose_error

FRAMES_PER_SECOND = 60.0  # of a short run
MOST_FRAMES = 1800
FINE = 200000  # steps of a position: 5 micrometres of a metre; deviations have steps of their own


def frame_times(log: RunLog) -> np.ndarray:
    """Times of the frames in s, the first and the last of the log among them."""
    span = float(log.time[-1] - log.time[0])
    count = int(min(MOST_FRAMES, max(2, round(span * FRAMES_PER_SECOND) + 1)))
    return np.linspace(log.time[0], log.time[-1], count)


def law_data(law: str, log: RunLog, times: np.ndarray, colors: Mapping[str, str]) -> dict[str, Any]:
    """What moves with one law; positions in m, angles in rad, errors in mm and degrees."""
    rows = np.clip(np.searchsorted(log.time, times), 0, len(log.time) - 1)
    X_WE = known_poses(log)[rows]
    error = pose_error(log.X_WE_desired[rows], X_WE)
    q = np.where(np.isfinite(log.link_position), log.link_position, log.joint_position)[rows]
    return {
        "id": law,
        "title": law_title(law),
        "color": colors[law],
        "q": [coded(q[:, joint], steps=FINE) for joint in range(q.shape[1])],
        "deflection": [coded((q - log.joint_position[rows])[:, joint]) for joint in range(q.shape[1])],
        "deviation": [coded(-error[:, 3 + axis], steps=FINE) for axis in range(3)],
        "tip_rotation": _quaternions(X_WE),
        "mm": coded(np.maximum(1e3 * np.linalg.norm(error[:, 3:], axis=1), 1e-5), is_log=True),
        "deg": coded(np.maximum(np.rad2deg(np.linalg.norm(error[:, :3], axis=1)), 1e-6), is_log=True),
    }


def replay_data(logs: Mapping[str, RunLog], shown_law: str) -> dict[str, Any]:
    """Everything that moves: ``times``, the wanted poses, and `law_data` of each law."""
    shown = logs[shown_law]
    times = frame_times(shown)
    rows = np.clip(np.searchsorted(shown.time, times), 0, len(shown.time) - 1)
    wanted = shown.X_WE_desired[rows]
    colors = law_colors(logs)
    on_path = shown.X_WE_desired[path_window(shown), :3, 3]
    low, high = on_path.min(axis=0), on_path.max(axis=0)
    return {
        "times": coded(times, steps=FINE),
        "marks": {name: getattr(shown, name) for name in ("path_start", "dwell_start", "path_end")},
        "wanted": [coded(wanted[:, axis, 3], steps=FINE) for axis in range(3)],
        "wanted_rotation": _quaternions(wanted),
        "box": [rounded(low, 5), rounded(high, 5)],
        "shown": shown_law,
        "laws": [law_data(law, log, times, colors) for law, log in logs.items()],
    }


def _quaternions(X: np.ndarray) -> list[dict[str, Any]]:
    """x, y, z, w of rotations (n, 4, 4), without jumps of the sign."""
    found = Rotation.from_matrix(X[:, :3, :3]).as_quat()
    flips = np.cumprod(np.where(np.sum(found[1:] * found[:-1], axis=1) < 0.0, -1.0, 1.0))
    found[1:] *= flips[:, None]
    return [coded(found[:, part], steps=FINE) for part in range(4)]
