"""The replay of a comparison: a meshcat recording in one HTML file that plays offline.

The robot moves as its links truly did, with the geometry that it truly had, so that its tool meets the true
path. Deviations are drawn to scale.
"""

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from html import escape
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    Box,
    Cylinder,
    Meshcat,
    MeshcatAnimation,
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from diagrams.log import RunLog
from experiments.metrics import path_window, pose_errors
from experiments.report_files import write_text
from experiments.report_style import WANTED_COLOR, law_colors, law_title
from robots.geometric_errors import GeometricErrors
from robots.model import RobotModel
from robots.plant import add_robot

FRAME_RATE = 30.0  # 1/s
TIP_RADIUS = 0.006  # m
WANTED_RADIUS = 0.003  # m; the wanted path is a translucent tube, which a true path 3 mm off leaves
PATH_RADIUS = 0.0015  # m
POINT_SPACING = 0.003  # m, along a path
TUBE_SIDES = 6
AXIS_COLORS = (Rgba(0.85, 0.1, 0.1), Rgba(0.1, 0.6, 0.1), Rgba(0.1, 0.25, 0.85))


def write_replay(
    path: str | Path,
    robot: RobotModel,
    logs: Mapping[str, RunLog],
    errors: GeometricErrors | None = None,
    shown_law: str | None = None,
) -> None:
    """Writes the recording as one self-contained HTML file, atomically.

    One law's robot moves, with frames at its true tool and at the wanted pose; the other laws show their tips
    and paths. Everything can be switched off in the scene tree: ``robot``, ``wanted`` and one entry per law.

    Args:
        logs: law -> log, all on the same path.
        errors: the true geometry of the robot; None for exact geometry.
        shown_law: whose robot moves; None takes the law with the smallest largest error.

    Raises:
        OSError: if the folder is missing or cannot be written.
        ValueError: if ``shown_law`` is not among the logs.
    """
    shown_law = shown_law or _best(logs)
    if shown_law not in logs:
        raise ValueError(f"replay: no log of law '{shown_law}', there are {', '.join(logs)}")
    shown = logs[shown_law]
    with _quiet_drake():
        # Port 0 lets the system pick a free one; nothing connects to it, the page is all we want.
        meshcat = Meshcat(MeshcatParams(host="localhost", port=0))
    _set_scene(meshcat, shown)
    times = np.arange(shown.time[0], shown.time[-1] + 0.5 / FRAME_RATE, 1.0 / FRAME_RATE)
    _record_robot(meshcat, robot, errors, shown, times)
    animation = meshcat.get_mutable_recording()
    colors = law_colors(logs)
    on_path = path_window(shown)
    wanted = shown.X_WE_desired[on_path, :3, 3]
    _draw_path(meshcat, "wanted/path", wanted, WANTED_RADIUS, _rgba(WANTED_COLOR, 0.5))
    _draw_frame(meshcat, "wanted/frame", length=0.14, radius=0.0018, alpha=0.45)
    _animate(animation, "wanted/frame", shown.time, shown.X_WE_desired, times)
    for law, log in logs.items():
        p_WE = log.X_WE_true[path_window(log), :3, 3]
        _draw_path(meshcat, f"{law}/path", p_WE, PATH_RADIUS, _rgba(colors[law]))
        if law == shown_law:
            _draw_frame(meshcat, f"{law}/tip", length=0.1, radius=0.003, alpha=1.0)
        else:
            meshcat.SetObject(f"{law}/tip", Sphere(TIP_RADIUS), _rgba(colors[law]))
        _animate(animation, f"{law}/tip", log.time, log.X_WE_true, times)
    animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    meshcat.PublishRecording()
    write_text(path, _with_legend(meshcat.StaticHtml(), colors, shown_law))


def _best(logs: Mapping[str, RunLog]) -> str:
    laws = [law for law in logs if law != "open_loop"] or list(logs)

    def largest(law: str) -> float:
        e = pose_errors(logs[law], "true")[path_window(logs[law])]
        return float(np.linalg.norm(e[:, 3:], axis=1).max(initial=0.0))

    return min(laws, key=largest)


def _record_robot(
    meshcat: Meshcat, robot: RobotModel, errors: GeometricErrors | None, log: RunLog, times: np.ndarray
) -> None:
    """Records a rigid robot at the true link positions; starts the recording that others add to."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    add_robot(plant, robot, elasticity="rigid", errors=errors)
    plant.Finalize()
    parameters = MeshcatVisualizerParams(prefix="robot", publish_period=1.0 / FRAME_RATE)
    visualizer = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    visualizer.StartRecording(set_transforms_while_recording=True)
    positions = np.stack([np.interp(times, log.time, log.link_position[:, i]) for i in range(6)], -1)
    for time, q in zip(times - times[0], positions, strict=True):
        context.SetTime(time)
        plant.SetPositions(plant_context, q)
        diagram.ForcedPublish(context)
    visualizer.StopRecording()


def _animate(
    animation: MeshcatAnimation, path: str, log_time: np.ndarray, X: np.ndarray, times: np.ndarray
) -> None:
    """Moves an object along sampled poses (n, 4, 4), taking the sample nearest to each frame."""
    nearest = np.clip(np.searchsorted(log_time, times), 0, len(log_time) - 1)
    for time, i in zip(times - times[0], nearest, strict=True):
        R = RotationMatrix.ProjectToRotationMatrix(X[i, :3, :3])
        pose = RigidTransform(R, X[i, :3, 3])
        animation.SetTransform(animation.frame(time), path, pose)


def _draw_path(meshcat: Meshcat, path: str, p: np.ndarray, radius: float, color: Rgba) -> None:
    """Draws positions (n, 3) as a tube: browsers draw lines one pixel wide, whatever they are told."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    keep = np.unique(np.append(np.unique(np.floor(along / POINT_SPACING), return_index=True)[1], len(p) - 1))
    if len(keep) < 2:
        return
    p = p[keep]
    tangent = np.gradient(p, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    # The world axis that a tangent has least of is a safe direction to start its cross-section from.
    side = np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent), axis=1)])
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
    up = np.cross(tangent, side)
    angle = 2.0 * np.pi * np.arange(TUBE_SIDES) / TUBE_SIDES
    ring = np.cos(angle)[:, None] * side[:, None, :] + np.sin(angle)[:, None] * up[:, None, :]
    vertices = (p[:, None, :] + radius * ring).reshape(-1, 3)
    start = TUBE_SIDES * np.arange(len(p) - 1)[:, None] + np.arange(TUBE_SIDES)
    beside = TUBE_SIDES * np.arange(len(p) - 1)[:, None] + (np.arange(TUBE_SIDES) + 1) % TUBE_SIDES
    lower = np.stack([start, beside, start + TUBE_SIDES], -1)
    upper = np.stack([beside, beside + TUBE_SIDES, start + TUBE_SIDES], -1)
    faces = np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])
    meshcat.SetTriangleMesh(path, vertices.T, faces.T, color)


def _draw_frame(meshcat: Meshcat, path: str, length: float, radius: float, alpha: float) -> None:
    """Three cylinders in red, green and blue along x, y and z."""
    for axis, color in enumerate(AXIS_COLORS):
        direction = np.eye(3)[axis]
        X = RigidTransform(RotationMatrix.MakeFromOneVector(direction, 2), 0.5 * length * direction)
        name = f"{path}/{'xyz'[axis]}"
        meshcat.SetObject(name, Cylinder(radius, length), Rgba(color.r(), color.g(), color.b(), alpha))
        meshcat.SetTransform(name, X)


def _set_scene(meshcat: Meshcat, log: RunLog) -> None:
    """Looks at robot and path from the front, a little from above, on a calm background with a floor."""
    meshcat.SetProperty("/Background/<object>", "top_color", [0.96, 0.97, 0.98])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [0.86, 0.88, 0.91])
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetObject("floor", Box(1.2, 1.4, 0.01), Rgba(0.8, 0.82, 0.85))
    meshcat.SetTransform("floor", RigidTransform([0.2, 0.0, -0.005]))
    p = log.X_WE_desired[:, :3, 3]
    middle = 0.5 * (p.min(axis=0) + p.max(axis=0))
    # Half way between base and path, so that the whole robot is in the picture.
    target = np.array([0.5 * middle[0], 0.5 * middle[1], 0.9 * middle[2]])
    meshcat.SetCameraPose(target + np.array([0.95, 0.42, 0.42]), target)


def _with_legend(html: str, colors: Mapping[str, str], shown_law: str) -> str:
    """Names the colours in a corner of the page."""
    entries = {"wanted, 3 mm radius": WANTED_COLOR}
    entries |= {
        law_title(law) + (" (robot)" if law == shown_law else ""): color for law, color in colors.items()
    }
    lines = "".join(
        f'<div><span style="display:inline-block;width:18px;height:4px;border-radius:2px;margin-right:8px;'
        f'vertical-align:middle;background:{color}"></span>{escape(title)}</div>'
        for title, color in entries.items()
    )
    legend = (
        '<div id="legend" style="position:fixed;left:14px;bottom:14px;padding:10px 14px;border-radius:8px;'
        "background:rgba(255,255,255,.85);color:#1c2430;font:14px/1.6 system-ui,sans-serif;"
        'pointer-events:none">'
        f"{lines}</div>"
    )
    html = html.replace("<title>Drake MeshCat</title>", "<title>truetip replay</title>")
    head, closing, tail = html.rpartition("</body>")
    return head + legend + closing + tail


def _rgba(color: str, alpha: float = 1.0) -> Rgba:
    red, green, blue = (int(color[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return Rgba(red, green, blue, alpha)


@contextmanager
def _quiet_drake() -> Iterator[None]:
    """Keeps Drake from announcing the address of a server that lives for a second."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.WARNING)
    try:
        yield
    finally:
        log.setLevel(level)
