"""An arm as capsules along its links and a ball around its tool, for distances from itself and from others.

Distances between shapes come from Drake's proximity queries; heights above a plane and places of the tool are
found for many configurations at once, so that few queries are left.
"""

from itertools import pairwise

import numpy as np
from pydrake.geometry import Box, Capsule, CollisionFilterDeclaration, GeometryId, GeometrySet, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import RigidBody
from pydrake.planning import RobotDiagramBuilder

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import add_robot
from robots.measurement_design.obstacles import Obstacle

_SHORTEST = 1e-6  # m, of a link that is a capsule
_SAMPLES = 100  # random configurations within the ranges
_ALWAYS = 0.9  # share of them in which two parts overlap that cannot be kept apart: they are drawn too thick


class ArmShapes:
    """The shapes of a robot, and what they must keep clear of."""

    def __init__(
        self, robot: RobotModel, tool_radius: float, clearance: float, obstacles: tuple[Obstacle, ...] = ()
    ) -> None:
        """Builds the geometry.

        Neighbours touch and are left out, and so are parts that overlap nearly everywhere as they are drawn.

        Args:
            robot: whose links they are.
            tool_radius: of the ball around the tool in m.
            clearance: the smallest distance in m that is allowed.
            obstacles: boxes in the world.
        """
        self._robot, self._clearance = robot, clearance
        self._radii = np.array([link.radius for link in robot.links[:-1]] + [max(tool_radius, 1e-3)])
        builder = RobotDiagramBuilder(0.0)
        plant = builder.plant()
        tool = add_robot(plant, robot, "rigid").tool
        base = plant.GetBodyByName("base")
        links = [plant.GetBodyByName(f"link_{number}") for number in range(1, NUM_JOINTS + 1)]
        friction = CoulombFriction(1.0, 1.0)
        shapes: list[list[GeometryId]] = []

        def add(body: RigidBody, end: np.ndarray, radius: float) -> None:
            length, ids = float(np.linalg.norm(end)), []
            if length > _SHORTEST:
                R = RotationMatrix.MakeFromOneVector(end / length, 2)
                capsule, X = Capsule(radius, length), RigidTransform(R, 0.5 * end)
                name = f"{body.name()}_shape"
                ids.append(plant.RegisterCollisionGeometry(body, X, capsule, name, friction))
            shapes.append(ids)

        add(base, robot.joints[0].placement.translation, robot.base_link.radius)
        for link, model, following in zip(links, robot.links, robot.joints[1:], strict=False):
            add(link, following.placement.translation, model.radius)
        ball, X_FE = Sphere(max(tool_radius, 1e-3)), tool.GetFixedPoseInBodyFrame()
        shapes.append([plant.RegisterCollisionGeometry(links[-1], X_FE, ball, "tool_shape", friction)])
        world = plant.world_body()
        boxes = [
            plant.RegisterCollisionGeometry(
                world, each.placement.pose(), Box(each.size), f"obstacle_{number}", friction
            )
            for number, each in enumerate(obstacles, 1)
        ]
        manager = builder.scene_graph().collision_filter_manager()
        manager.Apply(_neighbours(shapes, boxes))
        self._diagram = builder.Build()
        self._plant = self._diagram.plant()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        scene = self._diagram.scene_graph()
        self._query = scene.get_query_output_port()
        self._scene_context = scene.GetMyMutableContextFromRoot(self._context)
        self._leave_out_what_always_overlaps({each for ids in shapes for each in ids})

    @property
    def turns_with_axis_1(self) -> bool:
        """Whether the base is drawn round about axis 1."""
        first = self._robot.joints[0].placement
        axis = first.pose().rotation() @ self._robot.axes[0]
        return bool(np.linalg.norm(np.cross(axis, first.translation)) < _SHORTEST)

    def _leave_out_what_always_overlaps(self, own: set[GeometryId]) -> None:
        lower, upper = np.maximum(self._robot.lower, -np.pi), np.minimum(self._robot.upper, np.pi)
        counts: dict[tuple[GeometryId, GeometryId], int] = {}
        for q in np.random.default_rng(0).uniform(lower, upper, (_SAMPLES, NUM_JOINTS)):
            for pair in self._too_close(q):
                if pair.id_A in own and pair.id_B in own:
                    counts[pair.id_A, pair.id_B] = counts.get((pair.id_A, pair.id_B), 0) + 1
        always = CollisionFilterDeclaration()
        for (a, b), count in counts.items():
            if count > _ALWAYS * _SAMPLES:
                always.ExcludeBetween(GeometrySet(a), GeometrySet(b))
        scene = self._diagram.scene_graph()
        scene.collision_filter_manager(self._scene_context).Apply(always)

    def _too_close(self, q: np.ndarray) -> list:
        self._plant.SetPositions(self._plant_context, q)
        query = self._query.Eval(self._scene_context)
        # Only pairs that are closer than the clearance come back.
        return query.ComputeSignedDistancePairwiseClosestPoints(self._clearance)

    def is_clear(self, q: np.ndarray) -> bool:
        """Whether the arm keeps clear of itself, of its base and of the obstacles at q in rad, (6,)."""
        return not self._too_close(q)

    def lowest(self, q: np.ndarray) -> np.ndarray:
        """The height in m in the world of the lowest point of links 1 to 5 and the tool, (n, 6) -> (n,).

        The near end of link 1 does not move, and stands on the floor where joint 1 is there.
        """
        ends = self._ends(q)[..., 2]
        heights = np.minimum(ends[:, :-1], ends[:, 1:])[:, : NUM_JOINTS - 1]
        heights[:, 0] = ends[:, 1]
        heights = np.column_stack([heights, ends[:, -1]])
        return (heights - self._radii).min(axis=1)

    def _ends(self, q: np.ndarray) -> np.ndarray:
        """Origins of the six links and the tool in the world, (n, 6) -> (n, 7, 3) in m."""
        X, ends = np.tile(self._robot.base.pose().GetAsMatrix4(), (len(q), 1, 1)), []
        for i, (joint, axis) in enumerate(zip(self._robot.joints, self._robot.axes, strict=True)):
            X = X @ joint.placement.pose().GetAsMatrix4()
            ends.append(X[:, :3, 3])
            X = X @ _turns(axis, q[:, i])
        ends.append((X @ self._robot.tool.pose().GetAsMatrix4())[:, :3, 3])
        return np.stack(ends, 1)


def _neighbours(shapes: list[list[GeometryId]], boxes: list[GeometryId]) -> CollisionFilterDeclaration:
    """The pairs that need not be looked at: neighbours, the base and link 2, all that stands still.

    On either side of a link without length two others touch; Drake's search for their distance may not end.
    """
    found = CollisionFilterDeclaration()
    base = shapes[0]
    pairs = [*pairwise(ids for ids in shapes if ids), (base, shapes[2]), (base, boxes)]
    for a, b in pairs:
        if a and b:
            found.ExcludeBetween(GeometrySet(a), GeometrySet(b))
    if boxes:
        found.ExcludeWithin(GeometrySet(boxes))
    return found


def _turns(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Rotations about a unit axis as homogeneous matrices, (n,) -> (n, 4, 4)."""
    skew = np.cross(np.eye(3), axis)
    X = np.zeros((len(angles), 4, 4))
    X[:, 3, 3] = 1.0
    sine, versine = np.sin(angles)[:, None, None], 1.0 - np.cos(angles)[:, None, None]
    X[:, :3, :3] = np.eye(3) + sine * skew + versine * (skew @ skew)
    return X
