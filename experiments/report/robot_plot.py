"""Pictures of a robot and of places in its workspace, for plotly."""

import numpy as np
import plotly.graph_objects as go
from pydrake.math import RigidTransform, RotationMatrix

from robots.description.model import RobotModel
from robots.kinematics.forward import Kinematics, rotation_about

_INK, _SOFT = "#d2691e", "#9aa5b4"


def joint_origins(robot: RobotModel, q: np.ndarray) -> np.ndarray:
    """Base, origins of the six joints and tool in the world at joint positions in rad, (8, 3) in m."""
    X = robot.base.pose()
    points = [X.translation()]
    for joint, axis, angle in zip(robot.joints, robot.axes, q, strict=True):
        X = X @ joint.placement.pose()
        points.append(X.translation())
        X = X @ RigidTransform(RotationMatrix(rotation_about(axis, float(angle))), np.zeros(3))
    points.append((X @ robot.tool.pose()).translation())
    return np.array(points)


def tips_figure(robot: RobotModel, q: np.ndarray, names: list[str] | None = None) -> go.Figure:
    """The tool at configurations (n, 6) in rad, in the order of the visits, with the robot at zero."""
    tips = Kinematics(robot).forward(q)[:, :3, 3]
    order = np.arange(1, len(q) + 1)
    arm = joint_origins(robot, np.zeros(6))
    degrees = np.rad2deg(q)
    labels = names or [
        f"{k}: " + ", ".join(f"{a:.0f}°" for a in row) for k, row in zip(order, degrees, strict=True)
    ]
    figure = go.Figure(
        [
            go.Scatter3d(
                x=arm[:, 0], y=arm[:, 1], z=arm[:, 2], mode="lines+markers", name="robot at zero",
                line={"color": _INK, "width": 10}, marker={"size": 4, "color": _INK}, hoverinfo="name",
            ),
            go.Scatter3d(
                x=tips[:, 0], y=tips[:, 1], z=tips[:, 2], mode="lines+markers", name="tool",
                line={"color": _SOFT, "width": 1.5}, hovertext=labels, hoverinfo="text",
                marker={"size": 5, "color": order, "colorscale": "Viridis", "colorbar": {"title": "visit"}},
            ),
        ]
    )  # fmt: skip
    axes = {name: {"title": f"{name[0]} in m"} for name in ("xaxis", "yaxis", "zaxis")}
    figure.update_layout(scene={**axes, "aspectmode": "data"}, showlegend=False)
    return figure


def joints_figure(q: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> go.Figure:
    """Which positions each joint takes, and its limits, all in rad, shapes (n, 6), (6,), (6,)."""
    figure = go.Figure()
    for i in range(q.shape[1]):
        name = f"joint {i + 1}"
        limits = np.rad2deg([lower[i], upper[i]])
        figure.add_trace(
            go.Scatter(
                x=limits, y=[name, name], mode="lines", line={"color": _SOFT, "width": 8}, opacity=0.35
            )
        )
        figure.add_trace(
            go.Scatter(
                x=np.rad2deg(q[:, i]), y=[name] * len(q), mode="markers", name=name,
                marker={"size": 9, "color": "#0f7cc0", "opacity": 0.25},
            )
        )  # fmt: skip
    figure.update_layout(showlegend=False, xaxis={"title": "position in degrees"})
    return figure
