"""Pictures of modes: the lowest frequency over axes 2 and 3, and a mode that moves in Meshcat."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatVisualizer, MeshcatVisualizerParams
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from experiments.replay.scene import FRAME_RATE, open_meshcat
from experiments.report.files import write_text
from robots.description.model import RobotModel
from robots.dynamics.modes import Modes
from robots.dynamics.plant import add_robot

SHOWN_PERIOD = 2.0  # s; a period takes this long whatever the frequency
_SWING = 0.06  # of the distance from axis 1 to the tip: how far the tip swings


def frequency_figure(axis_2_deg: np.ndarray, axis_3_deg: np.ndarray, frequency_hz: np.ndarray) -> go.Figure:
    """Contours of a frequency over the positions of axes 2 and 3.

    Args:
        axis_2_deg: positions in degrees, shape (n,).
        axis_3_deg: positions in degrees, shape (m,).
        frequency_hz: shape (n, m).
    """
    figure = go.Figure(
        go.Contour(
            x=axis_2_deg,
            y=axis_3_deg,
            z=frequency_hz.T,
            colorscale="Viridis",
            contours={"showlabels": True, "labelfont": {"color": "white"}},
            colorbar={"title": "Hz"},
            hovertemplate="axis 2: %{x:.0f}°<br>axis 3: %{y:.0f}°<br>%{z:.2f} Hz<extra></extra>",
        )
    )
    return figure.update_layout(xaxis={"title": "axis 2 in degrees"}, yaxis={"title": "axis 3 in degrees"})


def show_mode(
    robot: RobotModel, elasticity: str, theta: np.ndarray, modes: Modes, mode: int, port: int | None = None
) -> Meshcat:
    """Starts a Meshcat server in which a mode swings for ever, exaggerated and slowed down.

    Args:
        robot: what swings.
        elasticity: of the model that the modes belong to.
        theta: positions of the motors in rad, shape (6,).
        modes: the modes there.
        mode: index of the one to show, from 0.
        port: where it listens; None for the first free one from 7000 on, 0 for any that is free.

    Raises:
        OSError: if no port is free.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    parts = add_robot(plant, robot, elasticity)
    plant.Finalize()
    positions = np.zeros(plant.num_positions())
    positions[[joint.position_start() for joint in parts.motors]] = theta
    rows = [joint.position_start() for joint in parts.sprung]
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, positions)
    tip = parts.tool.CalcPoseInWorld(context).translation()
    reach = float(np.linalg.norm(tip[:2]))
    shape = modes.shape[:, mode]

    # By the velocity of the tip: a mode that moves the tip little shall not be blown up beyond reason.
    velocities = np.zeros(plant.num_velocities())
    velocities[rows] = shape
    plant.SetVelocities(context, velocities)
    speed = np.linalg.norm(parts.tool.CalcSpatialVelocityInWorld(context).translational())
    amplitude = min(_SWING * reach / max(float(speed), 1e-12), 0.2 / np.abs(shape).max())

    meshcat = open_meshcat(np.array([tip, tip]), port)
    parameters = MeshcatVisualizerParams(prefix="robot", publish_period=1.0 / FRAME_RATE)
    visualizer = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
    diagram = builder.Build()
    target = np.array([0.5 * tip[0], 0.5 * tip[1], 0.35 * reach])
    meshcat.SetCameraPose(target + reach * np.array([0.35, -1.0, 0.35]), target)

    root = diagram.CreateDefaultContext()
    visualizer.StartRecording(set_transforms_while_recording=True)
    for time in np.arange(0.0, SHOWN_PERIOD, 1.0 / FRAME_RATE):
        root.SetTime(time)
        swung = positions.copy()
        swung[rows] = modes.rest + amplitude * np.sin(2.0 * np.pi * time / SHOWN_PERIOD) * shape
        plant.SetPositions(plant.GetMyMutableContextFromRoot(root), swung)
        diagram.ForcedPublish(root)
    visualizer.StopRecording()
    meshcat.get_mutable_recording().set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    visualizer.PublishRecording()
    return meshcat


def write_animation(path: str | Path, meshcat: Meshcat, title: str) -> None:
    """Writes what a Meshcat server shows as a page that plays offline.

    Raises:
        OSError: if it cannot be written.
    """
    html = meshcat.StaticHtml().replace("<title>Drake MeshCat</title>", f"<title>{title}</title>")
    write_text(path, html)
