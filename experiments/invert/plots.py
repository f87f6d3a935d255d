"""The page of a study of inverses: how the wrist rings, and what the motors do beside a rigid robot's."""

from html import escape
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.cli.console import count
from experiments.invert.study import KINDS, SETTLE, InvertStudy, ahead_of_rigid
from experiments.report.plot_page import Section, html_table, write_plot_page
from systems.feedforward import FEEDFORWARDS

TABLE_HEAD = ("inverse", "median C in m/s", "worst C in m/s", "relative to rigid")
_PERIOD_MS = 4.0


def table_rows(study: InvertStudy) -> list[list[str]]:
    """Criterion of each inverse over all positions and true robots."""
    rigid = np.median(study.criterion("rigid"))
    rows = []
    for kind, is_rehearsed in [(kind, False) for kind in KINDS] + [(kind, True) for kind in study.rehearsed]:
        found = study.found(kind, is_rehearsed)
        numbers = ("-",) * 3
        if len(found):
            middle = np.median(found)
            numbers = (f"{middle:.4f}", f"{found.max():.4f}", f"{middle / rigid:.4f}")
        rows.append([FEEDFORWARDS[kind].title + ", rehearsed" * is_rehearsed, *numbers])
    return rows


def verdict(study: InvertStudy) -> str:
    """What the stable inverse leaves, in a sentence or two."""
    ratio = study.ratio
    if np.isnan(ratio).all():
        return "The stable inverse was found in none of the positions."
    missing = int(np.isnan(ratio).sum())
    of = count(ratio.size, "motion") + (f" ({missing} without a solution)" if missing else "")
    robots = f", all springs of {len(ratio)} robots up to {study.spring_error:.0%} off" * bool(
        study.spring_error
    )
    over = f" (median of {of}{robots}), at worst {np.nanmax(ratio):.2f} times" if ratio.size > 1 else ""
    again = ""
    if study.rehearsed and np.isfinite(rehearsed := study.rehearsed_ratio).any():
        worst = f", at worst {np.nanmax(rehearsed):.2f} times" if ratio.size > 1 else ""
        again = (
            " With springs learnt from the motors' torques in one motion before it is "
            f"{np.nanmedian(rehearsed):.2f} times{worst}."
        )
    return (
        f"After {study.angle_deg:g} degrees the wrist rings {np.nanmedian(ratio):.2f} times as much with the "
        f"stable inverse as with the best causal one{over}. It takes {study.seconds:.1f} s to compute.{again}"
    )


def posture(pose: np.ndarray) -> str:
    """Where a motion begins, in words."""
    axis_2, axis_3 = np.rad2deg(pose[1:3])
    return f"{axis_2:.0f} and {axis_3:.0f} degrees"


def refusals(study: InvertStudy) -> list[str]:
    """A line for each position that the stable inverse refuses."""
    return [f"From axes 2 and 3 at {posture(pose)}: {reason}" for pose, reason in study.refusals]


def ringing_figure(study: InvertStudy) -> go.Figure:
    """How the wrist accelerates after the motion from the first position in which all inverses are there."""
    figure = go.Figure()
    curves = [
        (kind, FEEDFORWARDS[kind].title, study.ringing[kind][0][study.shown], "solid") for kind in KINDS
    ]
    for kind, of_robots in study.rehearsed.items():
        curves.append((kind, f"{FEEDFORWARDS[kind].title}, rehearsed", of_robots[0][study.shown], "dot"))
    for kind, name, one, dash in curves:
        if not len(one.times):
            continue
        size = np.linalg.norm(one.accelerations - one.accelerations.mean(axis=0), axis=1)
        style = {"color": FEEDFORWARDS[kind].colour, "dash": dash}
        time = 1e3 * (one.times - one.times[0])
        figure.add_trace(go.Scatter(x=time, y=size, name=name, line=style))
    yaxis = {"title": "acceleration in m/s<sup>2</sup>", "type": "log", "dtick": 1, "exponentformat": "none"}
    return figure.update_layout(xaxis={"title": "time after the motion in ms"}, yaxis=yaxis)


def motor_figure(study: InvertStudy) -> go.Figure:
    """How far motors 1 to 3 are from those of a rigid robot: before, during and after the motion."""
    figure = make_subplots(3, 1, shared_xaxes=True, vertical_spacing=0.05)
    for kind in KINDS[1:]:
        if kind not in study.example:
            continue
        turned = 1e3 * ahead_of_rigid(study, kind)
        time = _PERIOD_MS * np.arange(len(turned)) - 1e3 * SETTLE
        style = {"color": FEEDFORWARDS[kind].colour}
        for row in (1, 2, 3):
            curve = turned[:, row - 1] - turned[0, row - 1]
            trace = go.Scatter(x=time, y=curve, name=FEEDFORWARDS[kind].title, line=style, legendgroup=kind)
            figure.add_trace(trace.update(showlegend=row == 1), row, 1)
            figure.update_yaxes(title=f"motor {row} in mrad", row=row, col=1)
    figure.add_vline(x=0.0, line={"dash": "dot", "width": 1})
    return figure.update_xaxes(title="time from the start of the motion in ms", row=3)


def write_invert_page(path: Path, study: InvertStudy) -> None:
    """All of it as a page that opens offline."""
    text = "C adds up how much the wrist still accelerates in the 0.9 s after it, Reiner (2010), eq. (6.1)."
    if study.rehearsed:
        text += (
            " Rehearsed: the robot makes the motion once before, with the inverse of a rigid robot, and the "
            "springs of the model become those that explain the torques of its motors."
        )
    sections = [
        Section(
            "Ringing of the wrist",
            f"After the motion from axes 2 and 3 at {posture(study.poses[study.shown])}: the lower, the "
            "calmer.",
            ringing_figure(study),
            420,
        ),
        Section("All motions", text, html_table(TABLE_HEAD, table_rows(study))),
        Section(
            "What the motors do beside those of a rigid robot",
            "Less what they do at rest. The stable inverse moves them before the motion begins, which no "
            "causal one can, and goes on when it has ended.",
            motor_figure(study),
            760,
        ),
    ]
    if refused := refusals(study):
        listed = "".join(f"<li>{escape(line)}</li>" for line in refused)
        sections.insert(1, Section("Positions without a stable inverse", "", f"<ul>{listed}</ul>"))
    title = f"Stable inverse, {study.robot.name}, {study.payload:g} kg"
    write_plot_page(path, title, verdict(study), sections)
