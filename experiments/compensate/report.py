"""A corrected program as JSON and as a page: what was moved by how much, and what is left."""

from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from experiments.cli.console import count
from experiments.compensate.study import CompensationStudy
from experiments.report.plot_page import Section, html_table, sortable_table, write_plot_page
from experiments.report.robot_plot import joint_origins
from robots.programs.compensation import FalseTarget
from robots.programs.configuration import in_words

_INK, _SOFT, _BEFORE, _AFTER = "#d2691e", "#9aa5b4", "#9aa5b4", "#0f7cc0"
_LONGEST = 0.12  # of the size of the picture that the largest shift takes


def compensation_json(study: CompensationStudy) -> dict[str, Any]:
    """The numbers: lengths in mm, angles in degrees."""
    targets = []
    for each, after, new in zip(study.results, study.errors_after, study.corrected.targets, strict=True):
        targets.append(
            {
                "line": each.target.line,
                "name": each.target.name,
                "kind": "joints" if each.target.has_joints else "pose",
                "tool": each.target.tool.name if each.target.tool else None,
                "base": each.target.base.name,
                "payload_kg": each.payload,
                "shift_mm": (1e3 * each.shift[3:]).tolist(),
                "shift_deg": np.rad2deg(each.shift[:3]).tolist(),
                "joints_before_deg": np.rad2deg(each.q_before).tolist(),
                "joints_after_deg": np.rad2deg(each.q_after).tolist(),
                "configuration": in_words(new, new.numbers),
                "to_limit_deg": float(np.rad2deg(each.margin)),
                "error_before_mm": _millimetres(each.error_before),
                "error_after_mm": _millimetres(after),
                "remarks": list(each.remarks),
            }
        )
    return {
        "program": study.program.name,
        "targets": targets,
        "left_alone": [{"line": note.line, "what": note.text} for note in study.corrected.notes],
        "notes": list(study.notes),
        "error_before_mm": _worst(study.errors_before),
        "error_after_mm": _worst(study.errors_after),
        "error_after_deg": _worst_deg(study.errors_after),
        "error_in_single_precision_mm": _worst(study.errors_stored),
    }


def verdict(study: CompensationStudy) -> str:
    """What was reached, in words."""
    if not study.results:
        return f"{study.program.name}: no target was corrected."
    moved, left = len(study.results), len(study.corrected.notes)
    text = (
        f"{count(moved, 'target')} {'is' if moved == 1 else 'are'} moved by up to "
        f"{_worst(study.shifts):.3f} mm and {_worst_deg(study.shifts):.3f} degrees. Run through the "
        f"model of the robot, the error at the targets falls from {_worst(study.errors_before):.3f} mm to "
        f"{_worst(study.errors_after):.1e} mm, and to {_worst(study.errors_stored):.1e} mm where the "
        "controller keeps numbers in single precision."
    )
    if not left:
        return text
    return f"{text} {count(left, 'place')} {'is' if left == 1 else 'are'} left alone or to be looked at."


def write_compensation_page(page: Path, study: CompensationStudy) -> None:
    """The page; opens offline."""
    sections = []
    if study.results:
        note = "From each target along its shift, drawn longer than it is; the robot at the first target."
        sections.append(Section("Shifts", note, _shift_figure(study), 560))
        note = "Distance between wanted and true position, before and after, in the order of the program."
        sections.append(Section("Error at the targets", note, _error_figure(study), 320))
    names = ["line", "target", "tool", "base", "kg", "Δx mm", "Δy mm", "Δz mm", "shift mm", "turn °"]
    names += ["configuration", "to limit °", "before mm", "after mm", ""]
    note = "Shifts along the axes of the base, of joint targets of the tool. Configuration as it is written."
    sections.append(Section("Targets", note, sortable_table("targets", names, _rows(study))))
    left = [[str(note.line), note.text] for note in study.corrected.notes]
    left += [["", text] for text in study.notes]
    if left:
        sections.append(Section("Left alone, or to be looked at", "", html_table(["line", "what"], left)))
    write_plot_page(page, f"Compensation, {Path(study.program.name).name}", verdict(study), sections)


def _rows(study: CompensationStudy) -> list[list[str]]:
    rows = []
    for each, after, new in zip(study.results, study.errors_after, study.corrected.targets, strict=True):
        target, shift = each.target, 1e3 * each.shift[3:]
        rows.append(
            [
                str(target.line),
                target.name,
                target.tool.name if target.tool else "",
                target.base.name,
                f"{each.payload:g}",
                *(f"{value:.3f}" for value in shift),
                f"{np.linalg.norm(shift):.3f}",
                f"{np.rad2deg(np.linalg.norm(each.shift[:3])):.3f}",
                _configuration(each, in_words(new, new.numbers)),
                f"{np.rad2deg(each.margin):.1f}",
                f"{_millimetres(each.error_before):.3f}",
                f"{_millimetres(after):.1e}",
                "; ".join(each.remarks),
            ]
        )
    return rows


def _configuration(each: FalseTarget, after: str) -> str:
    before = in_words(each.target, each.target.numbers)
    return after if before == after else f"{before} → {after}"


def _shift_figure(study: CompensationStudy) -> go.Figure:
    points = np.array([each.X_WT[:3, 3] for each in study.results])
    shifts = np.array([_in_world(each) for each in study.results])
    arm = joint_origins(study.nominal, study.results[0].q_before)
    size = float(np.ptp(np.vstack([points, arm]), axis=0).max())
    longest = float(np.linalg.norm(shifts, axis=1).max())
    scale = _LONGEST * size / longest if longest > 0.0 else 1.0
    gap = np.full(len(points), np.nan)
    lines = [
        np.column_stack([p, p + scale * s, gap]).ravel() for p, s in zip(points.T, shifts.T, strict=True)
    ]
    labels = [
        f"line {each.target.line} {each.target.name}: {1e3 * np.linalg.norm(shift):.3f} mm"
        for each, shift in zip(study.results, shifts, strict=True)
    ]
    figure = go.Figure(
        [
            go.Scatter3d(
                x=arm[:, 0], y=arm[:, 1], z=arm[:, 2], mode="lines+markers", name="robot",
                line={"color": _SOFT, "width": 8}, marker={"size": 3, "color": _SOFT}, hoverinfo="name",
            ),
            go.Scatter3d(
                x=lines[0], y=lines[1], z=lines[2], mode="lines", name=f"shift, {scale:.0f} times as long",
                line={"color": _INK, "width": 5}, hoverinfo="name",
            ),
            go.Scatter3d(
                x=points[:, 0], y=points[:, 1], z=points[:, 2], mode="markers", name="target",
                marker={"size": 3, "color": _AFTER}, hovertext=labels, hoverinfo="text",
            ),
        ]
    )  # fmt: skip
    axes = {name: {"title": f"{name[0]} in m"} for name in ("xaxis", "yaxis", "zaxis")}
    figure.update_layout(scene={**axes, "aspectmode": "data"})
    return figure


def _in_world(each: FalseTarget) -> np.ndarray:
    """The shift of a position, along the axes of the world, m."""
    return each.shift[3:] if each.target.has_joints else each.target.base.X[:3, :3] @ each.shift[3:]


def _error_figure(study: CompensationStudy) -> go.Figure:
    figure, order = go.Figure(), np.arange(1, len(study.results) + 1)
    for name, errors, colour in (
        ("before", study.errors_before, _BEFORE),
        ("after, in single precision", study.errors_stored, _AFTER),
    ):
        distance = 1e3 * np.linalg.norm(errors[:, 3:], axis=1)
        trace = go.Scatter(
            x=order, y=distance, mode="markers", name=name, marker={"color": colour, "size": 6},
            text=[each.target.name for each in study.results], hovertemplate="%{text}: %{y:.3g} mm",
        )  # fmt: skip
        figure.add_trace(trace)
    figure.update_layout(
        xaxis={"title": "target, in the order of the program"}, yaxis={"title": "error in mm", "type": "log"}
    )
    return figure


def _millimetres(error: np.ndarray) -> float:
    return 1e3 * float(np.linalg.norm(error[3:]))


def _worst(errors: np.ndarray) -> float:
    """The largest distance in mm."""
    return 1e3 * float(np.linalg.norm(errors[:, 3:], axis=1).max(initial=0.0))


def _worst_deg(errors: np.ndarray) -> float:
    """The largest angle in degrees."""
    return float(np.rad2deg(np.linalg.norm(errors[:, :3], axis=1).max(initial=0.0)))
