"""Constraints on measurement configurations: joint limits, clearance of floor and base, visibility."""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    CollisionFilterDeclaration,
    GeometrySet,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import RigidBody
from pydrake.planning import RobotDiagramBuilder

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import add_robot
from robots.kinematics.forward import Kinematics


@dataclass(frozen=True)
class View:
    """A camera that must see the marker plate of the tool from its front."""

    camera: tuple[float, float, float] = (1.5, 0.0, 1.5)  # m, in the world
    plate: tuple[float, float, float] = (0.0, 0.0, 1.0)  # normal of the marker plate in the tool
    largest_angle_deg: float = 80.0  # between the normal and the direction to the camera


@dataclass(frozen=True)
class AdmissibleConfig:
    """Constraints besides the joint limits."""

    floor: float = 0.0  # m, height of the floor in the world
    clearance: float = 0.01  # m, smallest distance of the arm from the floor and from the robot's own base
    tool_radius: float = 0.05  # m, of a sphere around the tool that keeps clear too
    view: View | None = None  # None where the cameras stand all around


class AdmissibleConfigurations:
    """Checks whether configurations are admissible for a measurement.

    The arm is made of capsules along its links. Distances come from Drake's proximity queries. Links 1 and 2
    are next to the base and cannot touch it.
    """

    def __init__(self, robot: RobotModel, config: AdmissibleConfig | None = None) -> None:
        """Builds the geometry. Raises ValueError if a length is negative."""
        config = config or AdmissibleConfig()
        if config.clearance < 0.0 or config.tool_radius < 0.0:
            raise ValueError(
                "admissible configurations: clearance and tool_radius must not be negative, got "
                f"{config.clearance} m and {config.tool_radius} m"
            )
        self._robot, self._config = robot, config
        self._kinematics = Kinematics(robot)
        builder = RobotDiagramBuilder(0.0)
        plant = builder.plant()
        tool = add_robot(plant, robot, "rigid").tool
        base = plant.GetBodyByName("base")
        links = [plant.GetBodyByName(f"link_{number}") for number in range(1, NUM_JOINTS + 1)]
        friction = CoulombFriction(1.0, 1.0)
        floor = RigidTransform([0.0, 0.0, config.floor - 0.5])
        plant.RegisterCollisionGeometry(plant.world_body(), floor, Box(10.0, 10.0, 1.0), "floor", friction)

        def add(body: RigidBody, end: np.ndarray, radius: float) -> None:
            length = float(np.linalg.norm(end))
            if length > 1e-6:
                R = RotationMatrix.MakeFromOneVector(end / length, 2)
                capsule, X = Capsule(radius, length), RigidTransform(R, 0.5 * end)
                plant.RegisterCollisionGeometry(body, X, capsule, f"{body.name()}_shape", friction)

        add(base, robot.joints[0].placement.translation, robot.base_link.radius)
        for link, model, following in zip(links, robot.links, robot.joints[1:], strict=False):
            add(link, following.placement.translation, model.radius)
        X_FE = tool.GetFixedPoseInBodyFrame()
        ball = Sphere(max(config.tool_radius, 1e-3))
        plant.RegisterCollisionGeometry(links[-1], X_FE, ball, "tool_shape", friction)
        scene = builder.scene_graph()
        arm = GeometrySet([plant.GetBodyFrameIdOrThrow(link.index()) for link in links])
        fixed = GeometrySet([plant.GetBodyFrameIdOrThrow(base.index())])
        world = GeometrySet(plant.GetCollisionGeometriesForBody(plant.world_body()))
        near = GeometrySet([plant.GetBodyFrameIdOrThrow(link.index()) for link in links[:2]])
        declaration = (
            CollisionFilterDeclaration()
            .ExcludeWithin(arm)
            .ExcludeBetween(near, fixed)
            .ExcludeBetween(fixed, world)
        )
        scene.collision_filter_manager().Apply(declaration)
        self._diagram = builder.Build()
        self._plant = self._diagram.plant()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        scene = self._diagram.scene_graph()
        self._query = scene.get_query_output_port()
        self._scene_context = scene.GetMyContextFromRoot(self._context)

    def __call__(self, q: np.ndarray) -> np.ndarray:
        """Which of the joint positions in rad (n, 6) are admissible, (n,) bool."""
        q = np.asarray(q, dtype=float)
        tolerance = 1e-9
        inside = (q >= self._robot.lower - tolerance) & (q <= self._robot.upper + tolerance)
        found = np.asarray(inside.all(axis=1))
        if self._config.view is not None:
            found &= self._is_seen(q, self._config.view)
        for index in np.flatnonzero(found):
            found[index] = self._is_free(q[index])
        return found

    def _is_seen(self, q: np.ndarray, view: View) -> np.ndarray:
        X_WE = self._kinematics.forward(q)
        normal = X_WE[:, :3, :3] @ (np.array(view.plate) / np.linalg.norm(view.plate))
        towards = np.array(view.camera) - X_WE[:, :3, 3]
        cosine = np.sum(normal * towards, axis=1) / np.linalg.norm(towards, axis=1)
        return cosine >= np.cos(np.deg2rad(view.largest_angle_deg))

    def _is_free(self, q: np.ndarray) -> bool:
        self._plant.SetPositions(self._plant_context, q)
        query = self._query.Eval(self._scene_context)
        # Only pairs that are closer than the clearance come back.
        return not query.ComputeSignedDistancePairwiseClosestPoints(self._config.clearance)
