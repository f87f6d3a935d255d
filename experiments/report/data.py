"""The numbers that the plots of the report draw, thinned out so that the page stays small."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import Comparison, judged_by, known_poses, path_window, pose_errors
from experiments.report.curves import coded
from experiments.report.style import law_colors, law_title

LINE_SAMPLES = 2500  # per law and axis at most
MEASURED_SAMPLES = 900
PATH_SAMPLES = 700
EVENTS_PER_LAW = 500
FINE_STEPS = 200000  # of the largest error: a reader zooms in where it is small


def plot_data(result: Mapping[str, Any], logs: Comparison) -> dict[str, Any]:
    """Everything the script of the page needs, as plain lists: times in s, errors in mm and degrees.

    ``result`` is the `metrics.summary` of ``logs``.
    """
    longest = max((cycles[0] for cycles in logs.values()), key=lambda log: log.path_end)
    colors, source = law_colors(logs), judged_by(result)
    return {
        "marks": {name: getattr(longest, name) for name in ("path_start", "dwell_start", "path_end")},
        "laws": [
            {
                "id": law,
                "title": law_title(law),
                "color": colors[law],
                "line": _error_traces(cycles[0], source, LINE_SAMPLES),
                "measured": _error_traces(cycles[0], "measured", MEASURED_SAMPLES),
                "path": _path(cycles[0]),
                "bars": _bars(result["runs"][law][source]),
                "events": _events(cycles[0]),
            }
            for law, cycles in logs.items()
        ],
        "axis_range": _axis_ranges(logs, source),
    }


def _error_traces(log: RunLog, source: str, samples: int) -> dict[str, Any]:
    """Time, x, y, z in mm, turns about x, y, z in degrees, distance in mm and angle in degrees."""
    e = pose_errors(log, source)
    keep = np.flatnonzero(np.isfinite(e).all(axis=1) & (log.time <= log.path_end + 1e-9))
    keep = _thinned(keep, samples)
    e = e[keep]
    return {
        "t": coded(log.time[keep]),
        "mm": [coded(1e3 * e[:, 3 + axis], steps=FINE_STEPS) for axis in range(3)],
        "deg": [coded(np.rad2deg(e[:, axis]), steps=FINE_STEPS) for axis in range(3)],
        "norm_mm": coded(1e3 * np.linalg.norm(e[:, 3:], axis=1), is_log=True),
        "angle_deg": coded(np.rad2deg(np.linalg.norm(e[:, :3], axis=1)), is_log=True),
    }


def _path(log: RunLog) -> dict[str, Any]:
    """Wanted positions and the deviations from them, both in mm."""
    keep = _thinned(np.flatnonzero(path_window(log)), PATH_SAMPLES)
    wanted, found = log.X_WE_desired[keep, :3, 3], known_poses(log)[keep, :3, 3]
    return {
        "wanted": [_short(1e3 * wanted[:, axis]) for axis in range(3)],
        "deviation": [_short(1e3 * (found - wanted)[:, axis]) for axis in range(3)],
    }


def _events(log: RunLog) -> list[list[Any]]:
    return [[event.time, event.kind, event.detail] for event in log.guard_events[:EVENTS_PER_LAW]]


def _bars(numbers: Mapping[str, Any]) -> dict[str, float | None]:
    return {
        "max_mm": numbers["max_norm_mm"],
        "static_mm": norm(numbers["static_mm"]),
        "max_deg": numbers["max_angle_deg"],
        "static_deg": norm(numbers["static_deg"]),
    }


def norm(values: list[float | None]) -> float | None:
    """The length of a vector of numbers, None if one of them is missing."""
    known = [value for value in values if value is not None]
    return math.hypot(*known) if len(known) == len(values) else None


def _axis_ranges(logs: Comparison, source: str) -> dict[str, list[float]]:
    """Ranges that fit the laws on the path: the open loop would press them all flat."""
    laws = [law for law in logs if law != "open_loop"] or list(logs)
    on_path = [pose_errors(logs[law][0], source)[path_window(logs[law][0])] for law in laws]
    ranges = {}
    for name, columns, scale in (("mm", slice(3, 6), 1e3), ("deg", slice(0, 3), math.degrees(1.0))):
        largest = max((float(np.nanmax(np.abs(e[:, columns]), initial=0.0)) for e in on_path), default=0.0)
        half = 1.15 * scale * largest or 1.0
        ranges[name] = [-half, half]
    return ranges


def _thinned(indices: np.ndarray, samples: int) -> np.ndarray:
    """At most ``samples`` of the indices, evenly, the first and the last among them."""
    if len(indices) <= samples:
        return indices
    return indices[np.round(np.linspace(0, len(indices) - 1, samples)).astype(int)]


def _short(values: np.ndarray) -> list[float]:
    return [float(f"{value:.4g}") if math.isfinite(value) else 0.0 for value in values.tolist()]
