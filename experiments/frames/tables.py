"""Frames, tools and alignments in mm and degrees, as terminal tables and as JSON."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.cli.console import print_table
from experiments.cli.json_output import json_output
from robots.pose import zyx_from_rotation

MM = 1e3  # mm in a m


def pose_json(X: RigidTransform) -> dict[str, Any]:
    """A pose: translation in mm, ZYX Euler angles in degrees, and the rotation matrix by rows."""
    R = X.rotation().matrix()
    return {
        "translation_mm": MM * X.translation(),
        "zyx_deg": np.rad2deg(zyx_from_rotation(R)),
        "rotation_matrix": R,
    }


def print_pose(console: Console, title: str, X: RigidTransform) -> None:
    """Prints the homogeneous matrix, and below it the Euler angles."""
    table = Table(box=box.SIMPLE_HEAD, title=escape(title), title_justify="left", title_style="bold")
    table.add_column("")
    for name in ("x axis", "y axis", "z axis", "origin mm"):
        table.add_column(name, justify="right", no_wrap=True)
    for name, row, coordinate in zip("xyz", X.rotation().matrix(), MM * X.translation(), strict=True):
        table.add_row(name, *(f"{value:z.6f}" for value in row), f"{coordinate:z.4f}")
    print_table(console, table)
    alpha, beta, gamma = np.rad2deg(zyx_from_rotation(X.rotation().matrix()))
    console.print(f"  ZYX angles {alpha:z.4f}°, {beta:z.4f}°, {gamma:z.4f}°\n")


def print_facts(console: Console, result: Mapping[str, Any]) -> None:
    """Prints what a result says in a few numbers, one below the other; poses and residuals are left out."""
    table = Table(box=None, show_header=False, padding=(0, 2))
    table.add_column(style="dim")
    table.add_column()
    for name, value in result.items():
        if name != "file" and not isinstance(value, Mapping) and not name.startswith("residual"):
            table.add_row(name.replace("_", " "), _text(value))
    console.print(table)
    console.print()


def print_residuals(console: Console, result: Mapping[str, Any]) -> None:
    """Prints the residuals of a result, if it has any, by the lines of the file; an outlier is marked."""
    if "residual_lines" not in result:
        return
    units = {
        name: unit for name, unit in {"residuals_mm": "mm", "residuals_deg": "°"}.items() if name in result
    }
    table = Table(box=box.SIMPLE_HEAD, title="Residuals", title_justify="left", title_style="bold")
    table.add_column("line", justify="right")
    for unit in units.values():
        for name in ("x", "y", "z", "total"):
            table.add_column(f"{name} {unit}", justify="right", no_wrap=True)
    table.add_column("")
    for row, line in enumerate(result["residual_lines"]):
        vectors = [result[name][row] for name in units]
        cells = [f"{value:z.4f}" for vector in vectors for value in (*vector, np.linalg.norm(vector))]
        table.add_row(str(line), *cells, "outlier" if line in result["outlier_lines"] else "")
    print_table(console, table)


def _text(value: Any) -> str:
    """A number, several in a row, or a dash where there is none."""
    if isinstance(value, list | np.ndarray):
        return ", ".join(_text(item) for item in value) or "none"
    if value is None or math.isnan(value):
        return "–"
    return str(value) if isinstance(value, int) else f"{value:z.4f}"


def write_result(result: Mapping[str, Any], json_file: str | None) -> None:
    """Writes a result to a file, to stdout for ``-``, or nowhere; numbers that do not exist are null.

    Raises:
        OSError: if the file cannot be written.
    """
    with json_output(json_file) as output, output.staged():
        output.write(_plain(result))


def _plain(part: Any) -> Any:
    """Lists and numbers in place of arrays, None in place of NaN."""
    if isinstance(part, Mapping):
        return {key: _plain(value) for key, value in part.items()}
    if isinstance(part, list | np.ndarray):
        return [_plain(value) for value in part]
    if isinstance(part, np.floating | float):
        return None if math.isnan(part) else float(part)
    return part
