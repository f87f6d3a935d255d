"""Observations of wand and L-frame as a text table; errors are reported with file and line.

The first line names the columns, in any order: ``exposure``, ``camera``, ``point``, ``u_px``, ``v_px`` and,
if wanted, ``mean_of``. A point is ``A`` or ``B`` for the ends of the wand, or ``L1``, ``L2``, ... for a
sphere of the frame. Pixels of the frame are averaged over all exposures; a line that is a mean already says
of how many in ``mean_of``. Exposures of the wand are its places.
"""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robots.text_table import TextTableError, finite_number, parse_fields, read_text
from systems.vision.calibration.wand import WandRun

COLUMNS = ("exposure", "camera", "point", "u_px", "v_px")
MEAN_OF = "mean_of"  # a column that may be missing
ENDS = ("A", "B")


def read_observations(
    path: str | Path, cameras: Sequence[str], frame_points: int, sensor_px: np.ndarray | None = None
) -> WandRun:
    """Reads a table.

    Args:
        path: of the file.
        cameras: names of the cameras, in the order of the result.
        frame_points: number of spheres of the frame.
        sensor_px: width and height of the images, in which all pixels must lie; None if that is not known.

    Raises:
        TextTableError: if the file is missing, a column is, or a line says what cannot be; one line that says
            which.
    """
    return parse_observations(read_text(path), str(path), cameras, frame_points, sensor_px)


def parse_observations(
    text: str, name: str, cameras: Sequence[str], frame_points: int, sensor_px: np.ndarray | None = None
) -> WandRun:
    """The same from a text; ``name`` is where it came from. Raises what `read_observations` raises."""
    rows = _rows(text, name)
    points = [*ENDS, *(f"L{number}" for number in range(1, frame_points + 1))]
    camera_of = {camera: index for index, camera in enumerate(cameras)}
    frame: dict[tuple[int, int], list[tuple[float, float, int]]] = {}
    wand: dict[tuple[int, str, int], tuple[float, float]] = {}
    for where, row in rows:
        camera, point = row["camera"], row["point"]
        if camera not in camera_of:
            raise TextTableError(f"{where}: camera '{camera}' is none of the cell: {', '.join(cameras)}")
        if point not in points:
            raise TextTableError(f"{where}: point '{point}' must be one of {', '.join(points)}")
        pixel = _number(row["u_px"], where, "u_px"), _number(row["v_px"], where, "v_px")
        if sensor_px is not None:
            _refuse_outside(pixel, sensor_px, where)
        mean_of = _count(row.get(MEAN_OF, "1"), where)
        if point not in ENDS:
            frame.setdefault((camera_of[camera], int(point[1:]) - 1), []).append((*pixel, mean_of))
            continue
        if mean_of != 1:
            raise TextTableError(f"{where}: the wand moves, {MEAN_OF} must be 1 for {point}, got {mean_of}")
        key = camera_of[camera], row["exposure"], ENDS.index(point)
        if key in wand:
            raise TextTableError(f"{where}: camera {camera} has seen {point} in exposure {key[1]} already")
        wand[key] = pixel
    place_of = {exposure: index for index, exposure in enumerate(dict.fromkeys(key[1] for key in wand))}
    frame_pixels = np.full((len(cameras), frame_points, 2), np.nan)
    frame_exposures = np.zeros((len(cameras), frame_points), int)
    for place, rows_of_point in frame.items():
        u, v, exposures = np.array(rows_of_point).T
        frame_pixels[place] = np.average(np.stack([u, v]), axis=1, weights=exposures)
        frame_exposures[place] = exposures.sum()
    wand_pixels = np.full((len(cameras), len(place_of), 2, 2), np.nan)
    for (camera, exposure, end), pixel in wand.items():
        wand_pixels[camera, place_of[exposure], end] = pixel
    return WandRun(frame_pixels, frame_exposures, wand_pixels)


def observation_text(run: WandRun, cameras: Sequence[str]) -> str:
    """A table that `parse_observations` reads back."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow((*COLUMNS, MEAN_OF))
    for i, k in zip(*np.nonzero(run.frame_exposures), strict=True):
        pixel = _written(run.frame_pixels[i, k])
        writer.writerow(["frame", cameras[i], f"L{k + 1}", *pixel, run.frame_exposures[i, k]])
    for f, i, end in zip(*np.nonzero(~np.isnan(run.wand_pixels[..., 0]).swapaxes(0, 1)), strict=True):
        writer.writerow([f + 1, cameras[i], ENDS[end], *_written(run.wand_pixels[i, f, end]), 1])
    return out.getvalue()


def _written(pixel: np.ndarray) -> list[str]:
    return [f"{value:.6f}" for value in pixel]


def _rows(text: str, name: str) -> list[tuple[str, dict[str, str]]]:
    """Where each row stands in the file, and its fields by the names of their columns."""
    table = parse_fields(text, name, has_head=True)
    head, *body = table.rows
    for column in COLUMNS:
        if head.count(column) != 1:
            raise TextTableError(
                f"{table.where(0)}: needs one column '{column}' of {', '.join(COLUMNS)}, "
                f"got {', '.join(head)}"
            )
    if not body:
        raise TextTableError(f"{name}: no observations")
    for row, fields in enumerate(body, 1):
        if len(fields) != len(head):
            raise TextTableError(
                f"{table.where(row)}: {len(fields)} fields, the head has {len(head)} (decimal commas?)"
            )
    return [(table.where(row), dict(zip(head, fields, strict=True))) for row, fields in enumerate(body, 1)]


def _number(field: str, where: str, column: str) -> float:
    value = finite_number(field)
    if value is None:
        raise TextTableError(f"{where}: {column} must be a finite number with a decimal point, got '{field}'")
    return value


def _refuse_outside(pixel: tuple[float, float], sensor_px: np.ndarray, where: str) -> None:
    """Raises TextTableError for a pixel that is not in the image, whichever corner of a pixel counts from."""
    if not all(-1.0 <= at <= size + 1.0 for at, size in zip(pixel, sensor_px, strict=True)):
        width, height = sensor_px
        raise TextTableError(
            f"{where}: u_px and v_px must lie in the image of {width:g} by {height:g} px that the cell has, "
            f"got {pixel[0]:g} and {pixel[1]:g}; are u and v exchanged, or is the sensor another one?"
        )


def _count(field: str, where: str) -> int:
    if not field.isascii() or not field.isdigit() or int(field) < 1:
        raise TextTableError(f"{where}: {MEAN_OF} must be a number of exposures, one or more, got '{field}'")
    return int(field)
