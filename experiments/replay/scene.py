"""What the replay and the live view show in Meshcat: floor, robot, paths and frames."""

import numpy as np
from pydrake.geometry import (
    Box,
    Cylinder,
    Meshcat,
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from robots.description.geometric_errors import GeometricErrors
from robots.description.model import RobotModel
from robots.drake_log import quiet_drake
from robots.dynamics.plant import add_robot

FRAME_RATE = 30.0  # 1/s
POINT_SPACING = 0.003  # m, along a path
TUBE_SIDES = 6
AXIS_COLORS = (Rgba(0.85, 0.1, 0.1), Rgba(0.1, 0.6, 0.1), Rgba(0.1, 0.25, 0.85))


def open_meshcat(p_WE: np.ndarray, port: int | None = None) -> Meshcat:
    """Starts a Meshcat server on this machine, with a calm background, a floor and a view of robot and path.

    Args:
        p_WE: positions of the path in m, shape (n, 3); the camera looks at them from the front.
        port: where it listens; None for the first free one from 7000 on, 0 for any that is free.

    Raises:
        OSError: if no port is free.
    """
    with quiet_drake():  # which announces the address of a server, also of one that lives for a second
        try:
            meshcat = Meshcat(MeshcatParams(host="localhost", port=port))
        except RuntimeError as error:
            raise OSError(f"cannot start Meshcat on localhost: {' '.join(str(error).split())}") from error
    meshcat.SetProperty("/Background/<object>", "top_color", [0.96, 0.97, 0.98])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [0.86, 0.88, 0.91])
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetObject("floor", Box(1.2, 1.4, 0.01), Rgba(0.8, 0.82, 0.85))
    meshcat.SetTransform("floor", RigidTransform([0.2, 0.0, -0.005]))
    middle = 0.5 * (p_WE.min(axis=0) + p_WE.max(axis=0))
    # Half way between base and path, so that the whole robot is in the picture.
    target = np.array([0.5 * middle[0], 0.5 * middle[1], 0.9 * middle[2]])
    meshcat.SetCameraPose(target + np.array([0.95, 0.42, 0.42]), target)
    return meshcat


class RobotPicture:
    """A robot in a Meshcat window, moved by its link positions. It is rigid and has no dynamics."""

    def __init__(self, meshcat: Meshcat, robot: RobotModel, errors: GeometricErrors | None) -> None:
        """``errors`` are those of the true geometry; None for exact geometry."""
        builder = DiagramBuilder()
        self._plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        add_robot(self._plant, robot, elasticity="rigid", errors=errors)
        self._plant.Finalize()
        parameters = MeshcatVisualizerParams(prefix="robot", publish_period=1.0 / FRAME_RATE)
        self.visualizer = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()

    def show(self, time: float, q: np.ndarray) -> None:
        """Shows the link positions q (rad, shape (6,)) at a time in s."""
        self._context.SetTime(time)
        self._plant.SetPositions(self._plant.GetMyMutableContextFromRoot(self._context), q)
        self._diagram.ForcedPublish(self._context)


def draw_path(meshcat: Meshcat, path: str, p: np.ndarray, radius: float, color: Rgba) -> None:
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


def draw_frame(meshcat: Meshcat, path: str, length: float, radius: float, alpha: float) -> None:
    """Three cylinders in red, green and blue along x, y and z."""
    for axis, color in enumerate(AXIS_COLORS):
        direction = np.eye(3)[axis]
        X = RigidTransform(RotationMatrix.MakeFromOneVector(direction, 2), 0.5 * length * direction)
        name = f"{path}/{'xyz'[axis]}"
        meshcat.SetObject(name, Cylinder(radius, length), Rgba(color.r(), color.g(), color.b(), alpha))
        meshcat.SetTransform(name, X)


def rgba(color: str, alpha: float = 1.0) -> Rgba:
    """A colour given as #rrggbb."""
    red, green, blue = (int(color[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return Rgba(red, green, blue, alpha)
