"""Pictures of a calibration: where and how the robot was off, and what is left."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from scipy.stats import norm

from experiments.calibration.calibrate import CalibrationStudy
from experiments.metrics.run_metrics import path_window, pose_errors
from experiments.report.robot_plot import joint_origins
from robots.calibration.validation import prediction_errors
from robots.description.model import NUM_JOINTS, RobotModel

COLORS = {"before": "#9aa5b4", "after": "#0f7cc0"}
_AXES = {"x": "#d55e00", "y": "#009e73", "z": "#0f7cc0"}
_LEAST_MM = 1e-13  # rounding, where it happens to be nothing
_LONGEST = 0.15  # of the size of the picture that the largest error takes
_TRIAD = 0.08  # of the size of the robot


def spread_figure(study: CalibrationStudy) -> go.Figure:
    """Errors of both robots on the validation set."""
    assert study.sets.validation is not None
    figure = go.Figure()
    for name, robot in (("before", study.nominal), ("after", study.calibrated)):
        distance = np.linalg.norm(prediction_errors(robot, study.sets.validation)[:, -3:], axis=1)
        size = np.log10(np.maximum(1e3 * distance, _LEAST_MM))
        trace = go.Histogram(x=size, name=name, opacity=0.7, marker_color=COLORS[name])
        figure.add_trace(trace)
    ticks = list(range(-4, 3))
    axis = {"title": "error in mm", "tickvals": ticks, "ticktext": [f"{10.0**tick:g}" for tick in ticks]}
    figure.update_layout(barmode="overlay", xaxis=axis, yaxis={"title": "configurations"})
    return figure


def path_figure(path: Mapping[str, Any]) -> go.Figure:
    """Distance from the path in the course of time, before and after."""
    figure = go.Figure()
    for name in ("before", "after"):
        log = path[name]["log"]
        keep = path_window(log)
        distance = 1e3 * np.linalg.norm(pose_errors(log, "true")[keep, 3:], axis=1)
        time = log.time[keep] - log.path_start
        figure.add_trace(go.Scatter(x=time, y=distance, name=name, line={"color": COLORS[name]}))
    figure.update_layout(xaxis={"title": "time in s"}, yaxis={"title": "mm", "type": "log"})
    return figure


def vectors_figure(robot: RobotModel, points: np.ndarray, before: np.ndarray, after: np.ndarray) -> go.Figure:
    """Errors of positions as vectors in space, each kind drawn as many times longer as its name says.

    Args:
        robot: the nominal one, drawn at zero joint angles.
        points: where positions were measured in m, (n, 3).
        before, after: errors with the nominal and with the calibrated robot in m, (n, 3).
    """
    arm = joint_origins(robot, np.zeros(NUM_JOINTS))
    size = float(np.ptp(np.vstack([points, arm]), axis=0).max())
    figure = go.Figure(
        go.Scatter3d(
            x=arm[:, 0], y=arm[:, 1], z=arm[:, 2], mode="lines+markers", name="robot at zero",
            line={"color": "#c9d0d9", "width": 8}, marker={"size": 3, "color": "#c9d0d9"}, hoverinfo="name",
        )
    )  # fmt: skip
    for name, errors in (("before", before), ("after", after)):
        longest = float(np.linalg.norm(errors, axis=1).max(initial=0.0))
        scale = _LONGEST * size / longest if longest > 0.0 else 1.0
        factor = float(f"{scale:.2g}")  # as a number that one reads, not 2.1e+03
        gap = np.full(len(errors), np.nan)
        x, y, z = (
            np.column_stack([p, p + scale * e, gap]).ravel() for p, e in zip(points.T, errors.T, strict=True)
        )
        figure.add_trace(
            go.Scatter3d(
                x=x, y=y, z=z, mode="lines", name=f"{name}, {factor:g} times as long", hoverinfo="name",
                line={"color": COLORS[name] if name == "after" else "#d2691e", "width": 4},
            )
        )  # fmt: skip
    axes = {name: {"title": f"{name[0]} in m"} for name in ("xaxis", "yaxis", "zaxis")}
    figure.update_layout(scene={**axes, "aspectmode": "data"}, legend={"orientation": "h"})
    return figure


def joints_figure(q: np.ndarray, residuals: np.ndarray) -> go.Figure:
    """What is left of the positions against the angle of each joint: a wave is an error of that joint.

    Args:
        q: joint positions in rad, (n, 6).
        residuals: in m, (n, 3).
    """
    figure = make_subplots(
        2, 3, shared_yaxes=True, subplot_titles=[f"joint {i + 1}" for i in range(NUM_JOINTS)]
    )
    q, e = np.rad2deg(q), 1e3 * residuals
    for joint in range(NUM_JOINTS):
        for column, (axis, colour) in enumerate(_AXES.items()):
            figure.add_trace(
                go.Scatter(
                    x=q[:, joint], y=e[:, column], mode="markers", name=axis, legendgroup=axis,
                    showlegend=joint == 0, marker={"color": colour, "size": 4, "opacity": 0.7},
                ),
                row=joint // 3 + 1, col=joint % 3 + 1,
            )  # fmt: skip
    figure.update_yaxes(title_text="residual in mm", col=1)
    figure.update_xaxes(title_text="position in degrees", row=2)
    return figure


def noise_figure(values: np.ndarray, sigma: float) -> go.Figure:
    """Residuals in units of the noise, (n,), and how a normal distribution of that width would have them."""
    figure = go.Figure(
        go.Histogram(x=values, histnorm="probability density", name="residuals", marker_color=COLORS["after"])
    )
    if sigma > 0.0:
        x = np.linspace(-4.0, 4.0, 161)
        curve = norm.pdf(x, scale=sigma)
        figure.add_trace(go.Scatter(x=x, y=curve, name="expected", line={"color": "#d2691e", "width": 2}))
    figure.update_layout(xaxis={"title": "residual in units of the noise"}, yaxis={"title": "density"})
    return figure


def correlation_figure(names: Sequence[str], correlation: np.ndarray) -> go.Figure:
    """Which parameters the measurements tell apart badly; a correlation (n, n) of n names."""
    figure = go.Figure(
        go.Heatmap(
            z=correlation,
            x=list(names),
            y=list(names),
            zmin=-1.0,
            zmax=1.0,
            colorscale="RdBu",
            xgap=1,
            ygap=1,
        )
    )
    figure.update_layout(yaxis={"autorange": "reversed", "scaleanchor": "x"}, xaxis={"constrain": "domain"})
    return figure


def frames_figure(robot: RobotModel) -> go.Figure:
    """The frames along whose axes parameters count, with the robot at zero joint angles."""
    poses = [robot.base.pose()]
    for joint in robot.joints:
        poses.append(poses[-1] @ joint.placement.pose())
    poses.append(poses[-1] @ robot.tool.pose())
    points = np.array([X.translation() for X in poses])
    length = _TRIAD * max(float(np.ptp(points, axis=0).max()), 0.1)
    figure = go.Figure(
        go.Scatter3d(
            x=points[:, 0], y=points[:, 1], z=points[:, 2], mode="lines+text", hoverinfo="skip",
            text=["base", *(f"joint {i}" for i in range(1, NUM_JOINTS + 1)), "tool"],
            line={"color": "#c9d0d9", "width": 8}, textfont={"size": 11}, showlegend=False,
        )
    )  # fmt: skip
    gap = np.full(len(points), np.nan)
    for column, (axis, colour) in enumerate(_AXES.items()):
        tips = points + length * np.array([X.rotation().matrix()[:, column] for X in poses])
        x, y, z = (np.column_stack([a, b, gap]).ravel() for a, b in zip(points.T, tips.T, strict=True))
        figure.add_trace(
            go.Scatter3d(x=x, y=y, z=z, mode="lines", name=axis, line={"color": colour, "width": 5})
        )
    middle, half = 0.5 * (points.min(0) + points.max(0)), 0.5 * float(np.ptp(points, axis=0).max()) + length
    axes = {
        f"{letter}axis": {"title": f"{letter} in m", "range": [float(m) - half, float(m) + half]}
        for letter, m in zip("xyz", middle, strict=True)
    }
    camera = {"eye": {"x": 1.5, "y": -1.3, "z": 0.5}}
    figure.update_layout(scene={**axes, "aspectmode": "cube", "camera": camera}, legend={"orientation": "h"})
    return figure
