"""``errors.csv``: the errors of a comparison over time, for other programs and for the next comparison."""

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import judged_source, pose_errors
from experiments.report.files import write_text

ERRORS = "errors.csv"
_HEAD = ("law", "time_s", "distance_mm", "angle_deg", "x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg")
Course = tuple[
    np.ndarray, np.ndarray, np.ndarray
]  # times in s, distances in mm, angles in degrees, (n,) each


def write_errors(path: Path, logs: Mapping[str, RunLog]) -> None:
    """Writes a line for each sample of each law, errors e = wanted - attained in world axes, atomically.

    They are the true ones, or the measured ones on a real station.

    Raises:
        OSError: if the folder is missing or cannot be written.
    """
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(_HEAD)
    for law, log in logs.items():
        e = pose_errors(log, judged_source(log))
        mm, degrees = 1e3 * e[:, 3:], np.rad2deg(e[:, :3])
        sizes = [np.linalg.norm(part, axis=1)[:, None] for part in (mm, degrees)]
        columns = np.hstack([log.time[:, None], *sizes, mm, degrees])
        for row in columns[np.isfinite(columns).all(axis=1)].tolist():
            lines.writerow([law, *(f"{value:.6g}" for value in row)])
    write_text(path, text.getvalue())


def read_errors(path: Path) -> dict[str, Course]:
    """Distances and angles over time of each law.

    Raises:
        OSError: if the file cannot be read.
        ValueError: if it is no such table; one line with the file.
    """
    rows: dict[str, list[tuple[float, float, float]]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        lines = csv.reader(file)
        if tuple(next(lines, ())) != _HEAD:
            raise ValueError(f"{path}: its first line must be {','.join(_HEAD)}")
        for number, line in enumerate(lines, 2):
            try:
                time, distance, angle = map(float, line[1:4])
            except ValueError as error:
                raise ValueError(f"{path}, line {number}: needs a law and numbers, got {line}") from error
            rows.setdefault(line[0], []).append((time, distance, angle))
    return {law: tuple(np.array(values).T) for law, values in rows.items()}  # type: ignore[misc]
