"""Results of a camera study as terminal tables and as a page."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.cameras.laws import LawResult
from experiments.cameras.plots import ENLARGED, ellipsoid_figure, sweep_figure, workspace_figure
from experiments.cameras.study import CamerasStudy, study_verdict
from experiments.cameras.sweeps import SWEEPS, SweepPoint
from experiments.cli.console import print_table
from experiments.report.plot_page import Section, html_table, write_plot_page
from experiments.report.style import law_title

LAW_HEAD = ("law", "camera", "Hz", "max mm", "rms mm", "rest mm", "max °", "rest °")
_TABLE: dict[str, Any] = {
    "box": box.SIMPLE_HEAD,
    "title_justify": "left",
    "title_style": "italic",
    "pad_edge": False,
}


def print_study(console: Console, study: CamerasStudy) -> None:
    """A table of the sweeps and one of the laws."""
    table = Table(title="Standard deviation of the position on the path along an axis", **_TABLE)
    for head in ("what", "changed", "in µm", "best µm", "at"):
        table.add_column(head, justify="left" if head in ("what", "changed", "at") else "right", no_wrap=True)
    for name, points in study.varied.items():
        first, last = points[0], points[-1]
        best = min(points, key=lambda point: np.nan_to_num(point.path.position, nan=np.inf))
        unit = SWEEPS[name].unit
        table.add_row(
            escape(SWEEPS[name].title),
            f"{first.value:g} → {last.value:g} {unit}",
            f"{_micrometres(first)} → {_micrometres(last)}",
            _micrometres(best),
            f"{best.value:g} {unit}",
        )
    print_table(console, table)
    if study.laws:
        laws = Table(title="Servo laws, true errors", **_TABLE)
        for head in LAW_HEAD:
            laws.add_column(head, justify="left" if head in LAW_HEAD[:2] else "right", no_wrap=True)
        for row in _law_rows(study.laws):
            laws.add_row(*(escape(cell) for cell in row))
        print_table(console, laws)
    console.print(escape(study_verdict(study)))


def write_study_page(path: Path, title: str, study: CamerasStudy) -> None:
    """The page of a study; opens offline."""
    setup = study.setup
    cameras = setup.cell.camera_model(setup.robot.base.pose())
    ellipsoids = ellipsoid_figure(setup.robot, setup.path, study.covariance_on_path)
    dots = workspace_figure(setup.robot, cameras, setup.workspace, study.covariance_in_workspace)
    note = (
        f"Three standard deviations σ of the position, {ENLARGED:g} times as large, for pixels of "
        f"{setup.pixel_sigma:g} px; markers that touch each other in an image count as one there."
    )
    note_workspace = "Configurations that touch neither floor nor base; lines point at the cameras."
    sections = [
        Section("Along the path", note, ellipsoids, 620),
        Section("Over the workspace", note_workspace, dots, 620),
    ]
    for name, points in study.varied.items():
        sweep = SWEEPS[name]
        sections.append(Section(sweep.title, sweep.note, sweep_figure(sweep, points), 320))
        if any(
            point.cameras or point.pixel_sigma not in (setup.pixel_sigma, point.value) for point in points
        ):
            sections.append(Section(f"{sweep.title}: in numbers", "", _point_table(sweep.axis, points)))
    if study.laws:
        note = "True errors on the path and at rest, with one camera after the other and with fewer frames."
        sections.append(Section("Servo laws", note, html_table(LAW_HEAD, _law_rows(study.laws))))
    write_plot_page(path, f"Cameras, {title}", study_verdict(study), sections)


def _point_table(axis: str, points: Sequence[SweepPoint]) -> str:
    """Which cameras serve best, or how exactly images tell where markers are."""
    named = any(point.cameras for point in points)
    head = [axis, "which" if named else "centroid px", *(() if named else ("found %",))]
    rows = []
    for point in points:
        what = [" ".join(point.cameras)] if named else _pictured(point)
        numbers = ["-" if number is None else f"{number:.1f}" for number in _numbers(point)]
        rows.append([f"{point.value:g}", *what, *numbers])
    return html_table([*head, "path µm", "workspace µm", "path 0.001°"], rows)


def _pictured(point: SweepPoint) -> list[str]:
    sigma = f"{point.pixel_sigma:.4f}" if np.isfinite(point.pixel_sigma) else "-"
    return [sigma, f"{100.0 * point.found:.0f}"]


def _numbers(point: SweepPoint) -> tuple[float | None, float | None, float | None]:
    path, workspace = point.path.as_dict(), point.workspace.as_dict()
    return path["position_um"], workspace["position_um"], path["rotation_mdeg"]


def _micrometres(point: SweepPoint) -> str:
    position = point.path.as_dict()["position_um"]
    return "unseen" if position is None else f"{position:.3g}"


def _law_rows(laws: Sequence[LawResult]) -> list[list[str]]:
    rows = []
    for result in laws:
        errors = result.errors
        numbers = (
            errors["max_norm_mm"],
            errors["rms_norm_mm"],
            np.linalg.norm(errors["static_mm"]),
            errors["max_angle_deg"],
            np.linalg.norm(errors["static_deg"]),
        )
        name = [law_title(result.law), result.camera, f"{result.rate_hz:g}"]
        digits = (3, 3, 4, 3, 4)
        rows.append([*name, *(f"{n:.{d}f}" for n, d in zip(numbers, digits, strict=True))])
    return rows
