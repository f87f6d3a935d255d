"""Constraints on measurement configurations: limits, floor, obstacles, the arm itself, volume, visibility."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.description.model import RobotModel
from robots.kinematics.forward import Kinematics
from robots.kinematics.workspace import shoulder
from robots.measurement_design.arm_shapes import ArmShapes
from robots.measurement_design.obstacles import Obstacle

_TOLERANCE = 1e-9  # rad, beyond a limit
_ON_AXIS = 1e-9  # m, and of a cosine
_UPRIGHT, _NO_FLOOR = 0.99, 100.0  # cosine of axis 1 and the vertical, and m


@dataclass(frozen=True)
class View:
    """A camera that must see the marker plate of the tool from its front."""

    camera: tuple[float, float, float] = (1.5, 0.0, 1.5)  # m, in the world
    plate: tuple[float, float, float] = (0.0, 0.0, 1.0)  # normal of the marker plate in the tool
    largest_angle_deg: float = 80.0  # between the normal and the direction to the camera


@dataclass(frozen=True)
class AdmissibleConfig:
    """Constraints besides the joint limits."""

    floor: float | None = None  # m, its height in the world; None for the one that the robot stands on
    clearance: float = (
        0.01  # m, smallest distance of the arm from all that it must not touch, and from itself
    )
    tool_radius: float = 0.05  # m, of a ball around the tool that keeps clear too
    view: View | None = None  # None where the cameras stand all around
    box: tuple[np.ndarray, np.ndarray] | None = None  # m, corners of the volume in which the tool is measured
    obstacles: tuple[Obstacle, ...] = ()


class AdmissibleConfigurations:
    """Checks whether configurations are admissible for a measurement.

    The arm is made of capsules along its links. Distances come from Drake's proximity queries, for what
    simpler checks have left.
    """

    def __init__(self, robot: RobotModel, config: AdmissibleConfig | None = None) -> None:
        """Builds the geometry. Raises ValueError if a length is negative or a box empty."""
        config = config or AdmissibleConfig()
        if config.clearance < 0.0 or config.tool_radius < 0.0:
            raise ValueError(
                "admissible configurations: clearance and tool_radius must not be negative, got "
                f"{config.clearance} m and {config.tool_radius} m"
            )
        if config.box is not None and not (config.box[0] < config.box[1]).all():
            corners = " and ".join(str(corner.tolist()) for corner in config.box)
            raise ValueError(f"admissible configurations: a box needs increasing corners, got {corners} m")
        self._robot, self._config = robot, config
        self._floor = floor_under(robot, config.clearance) if config.floor is None else config.floor
        self._kinematics = Kinematics(robot)
        self._shapes = ArmShapes(robot, config.tool_radius, config.clearance, config.obstacles)

    def indifferent(self, angles: Sequence[np.ndarray]) -> tuple[int, ...]:
        """Joints on which it does not depend whether a configuration of a grid is admissible.

        On an upright axis 1 the arm turns as a whole; axis 6 turns a tool that stands on it.

        Args:
            angles: of the six joints in rad, those of the grid.

        Returns:
            Their indices.
        """
        robot, config = self._robot, self._config
        axis, place = robot.axes[5], robot.tool.translation
        found = [5] if np.linalg.norm(np.cross(axis, place)) < _ON_AXIS and config.view is None else []
        is_free = config.view is None and config.box is None and not config.obstacles
        if is_free and self._shapes.turns_with_axis_1 and self._has_no_slope():
            found.append(0)
        inside = [
            bool((a >= low - _TOLERANCE).all() and (a <= high + _TOLERANCE).all())
            for a, low, high in zip(angles, robot.lower, robot.upper, strict=True)
        ]
        return tuple(joint for joint in sorted(found) if inside[joint])

    def _has_no_slope(self) -> bool:
        """Whether axis 1 stands upright on the floor, or there is no floor within reach."""
        origin, up = shoulder(self._robot)
        return abs(up[2]) > 1.0 - _ON_AXIS or self._floor < origin[2] - 0.5 * _NO_FLOOR

    def __call__(self, q: np.ndarray) -> np.ndarray:
        """Which of the joint positions in rad (n, 6) are admissible, (n,) bool."""
        q = np.asarray(q, dtype=float)
        inside = (q >= self._robot.lower - _TOLERANCE) & (q <= self._robot.upper + _TOLERANCE)
        found = np.asarray(inside.all(axis=1))
        if self._config.view is not None or self._config.box is not None:
            X_WE = self._kinematics.forward(q)
            found &= self._is_in_box(X_WE) & self._is_seen(X_WE)
        rest = np.flatnonzero(found)
        found[rest] = self._shapes.lowest(q[rest]) >= self._floor + self._config.clearance
        for index in np.flatnonzero(found):
            found[index] = self._shapes.is_clear(q[index])
        return found

    def _is_in_box(self, X_WE: np.ndarray) -> np.ndarray:
        if self._config.box is None:
            return np.ones(len(X_WE), dtype=bool)
        lower, upper = self._config.box
        return np.asarray(((X_WE[:, :3, 3] >= lower) & (X_WE[:, :3, 3] <= upper)).all(axis=1))

    def _is_seen(self, X_WE: np.ndarray) -> np.ndarray:
        view = self._config.view
        if view is None:
            return np.ones(len(X_WE), dtype=bool)
        normal = X_WE[:, :3, :3] @ (np.array(view.plate) / np.linalg.norm(view.plate))
        towards = np.array(view.camera) - X_WE[:, :3, 3]
        cosine = np.sum(normal * towards, axis=1) / np.linalg.norm(towards, axis=1)
        return np.asarray(cosine >= np.cos(np.deg2rad(view.largest_angle_deg)))


def floor_under(robot: RobotModel, clearance: float = 0.0) -> float:
    """The height in m of the floor on which a robot stands; far below where it hangs or stands on a wall.

    It stands where its file has the origin, unless that is so near joint 2 that the arm would always touch
    the floor there: then it stands on something.

    Args:
        robot: that stands.
        clearance: smallest distance in m that its links keep from the floor.
    """
    joint_2, up = shoulder(robot)
    if up[2] <= _UPRIGHT:
        return -_NO_FLOOR
    radius = max(link.radius for link in robot.links[:2])
    return min(float(robot.base.translation[2]), float(joint_2[2]) - radius - clearance - _TOLERANCE)
