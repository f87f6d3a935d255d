"""Figures of camera accuracy: ellipsoids along the path, points in the workspace, curves."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from experiments.cameras.accuracy import Places
from experiments.cameras.sweeps import Sweep, SweepPoint
from experiments.report.robot_plot import joint_origins
from robots.description.model import RobotModel
from systems.vision.camera_model import Cameras

ENLARGED = 500.0  # times, of the ellipsoids
_SIGMAS = 3.0  # from the middle of an ellipsoid to its surface
_INK, _SOFT, _BLUE, _ORANGE = "#5b6675", "#9aa5b4", "#0f7cc0", "#d2691e"
_SIGHT = 1.1, 1.4  # m from the middle of the workspace, where lines point at the cameras
SCENE = {
    "aspectmode": "data",
    "camera": {"eye": {"x": 1.7, "y": 1.7, "z": 1.1}},  # the default one cuts corners off
    **{f"{axis}axis": {"title": f"{axis} in m"} for axis in "xyz"},
}


def ellipsoid_figure(robot: RobotModel, places: Places, covariance: np.ndarray) -> go.Figure:
    """Ellipsoids of the position's error of three sigma, enlarged, at poses with covariances (p, 6, 6)."""
    seen = np.isfinite(covariance[:, 0, 0])
    middle, spread = places.X_WE[seen, :3, 3], covariance[seen, 3:, 3:]
    points, triangles = _sphere(12, 8)
    axes, directions = np.linalg.eigh(spread)
    shape = directions * (_SIGMAS * ENLARGED * np.sqrt(axes))[:, None]
    surfaces = middle[:, None] + points @ shape.swapaxes(1, 2)
    x, y, z = surfaces.reshape(-1, 3).T
    i, j, k = (triangles + len(points) * np.arange(len(middle))[:, None, None]).reshape(-1, 3).T
    sigma = 1e6 * np.sqrt(np.trace(spread, axis1=1, axis2=2) / 3.0)
    figure = go.Figure(
        go.Mesh3d(
            x=x, y=y, z=z, i=i, j=j, k=k, intensity=np.repeat(sigma, len(points)), colorscale="Viridis",
            colorbar={"title": "σ in µm"}, flatshading=False, opacity=0.9,
            hovertemplate="%{intensity:.1f} µm along an axis<extra></extra>",
        )
    )  # fmt: skip
    x, y, z = places.X_WE[:, :3, 3].T
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="lines", line={"color": _INK}, name="path"))
    figure.add_trace(_arm(robot, places.q[0]))
    return figure.update_layout(scene=SCENE, showlegend=False)


def workspace_figure(
    robot: RobotModel, cameras: Cameras, places: Places, covariance: np.ndarray
) -> go.Figure:
    """The standard deviation of the position at poses all over the workspace, and where the cameras are."""
    sigma = 1e6 * np.sqrt(np.trace(covariance[:, 3:, 3:], axis1=1, axis2=2) / 3.0)
    x, y, z = places.X_WE[:, :3, 3].T
    color = {"color": sigma, "colorscale": "Viridis", "size": 4, "colorbar": {"title": "σ in µm"}}
    figure = go.Figure(
        go.Scatter3d(
            x=x, y=y, z=z, mode="markers", marker=color, customdata=sigma,
            hovertemplate="%{customdata:.1f} µm along an axis<extra></extra>",
        )
    )  # fmt: skip
    # The cameras are far away: short lines point at them.
    middle = places.X_WE[:, :3, 3].mean(0)
    sight = cameras.p_WC - middle
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    lines = np.stack([middle + _SIGHT[0] * sight, middle + _SIGHT[1] * sight, np.full_like(sight, np.nan)], 1)
    x, y, z = lines.reshape(-1, 3).T
    pointers = {"color": _ORANGE, "width": 5}
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="lines", line=pointers, name="to a camera"))
    figure.add_trace(_arm(robot, np.zeros(6)))
    return figure.update_layout(scene=SCENE, showlegend=False)


def sweep_figure(sweep: Sweep, points: Sequence[SweepPoint]) -> go.Figure:
    """Standard deviations of the position over what is changed."""
    x = [point.value for point in points]
    curves = {
        "path": ([1e6 * point.path.position for point in points], {"color": _BLUE}),
        "path, worst tenth": (
            [1e6 * point.path.worst_position for point in points],
            {"color": _BLUE, "dash": "dot"},
        ),
        "workspace": ([1e6 * point.workspace.position for point in points], {"color": _ORANGE}),
    }
    figure = go.Figure()
    for name, (y, line) in curves.items():
        figure.add_trace(go.Scatter(x=x, y=y, name=name, mode="lines+markers", line=line))
    return figure.update_layout(
        xaxis={"title": sweep.axis}, yaxis={"title": "σ along an axis in µm", "rangemode": "tozero"}
    )


def _arm(robot: RobotModel, q: np.ndarray) -> go.Scatter3d:
    x, y, z = joint_origins(robot, q).T
    line = {"color": _SOFT, "width": 10}
    return go.Scatter3d(x=x, y=y, z=z, mode="lines", line=line, name="robot", hoverinfo="name")


def _sphere(around: int, along: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 3) on the unit sphere and the triangles between them, indices (t, 3)."""
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    rise = np.linspace(-0.5 * np.pi, 0.5 * np.pi, along)
    points = np.stack(
        [
            np.outer(np.cos(rise), np.cos(turn)),
            np.outer(np.cos(rise), np.sin(turn)),
            np.outer(np.sin(rise), np.ones(around)),
        ],
        -1,
    ).reshape(-1, 3)
    row, column = np.divmod(np.arange((along - 1) * around), around)
    here, beside = row * around + column, row * around + (column + 1) % around
    return points, np.concatenate(
        [np.stack([here, beside, beside + around], -1), np.stack([here, beside + around, here + around], -1)]
    )
