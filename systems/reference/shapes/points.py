"""Straight lines from way point to way point: through the corners of a rectangle, or with a rest at each."""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import ClassVar

import numpy as np

from systems.reference.segment import Segment, line, require_vectors, rotation


@dataclass
class Waypoint:
    """A pose of the tool in the world: translation in mm, ZYX angles (alpha, beta, gamma) in degrees."""

    # Position of the tool in the world
    translation_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))
    # Alpha, beta, gamma of the tool in the world
    zyx_deg: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def pose(self) -> np.ndarray:
        """The pose X_WE, shape (4, 4)."""
        X = np.eye(4)
        X[:3, :3] = rotation(self.zyx_deg)
        X[:3, 3] = 1e-3 * np.asarray(self.translation_mm)
        return X


def rectangle_waypoints() -> list[Waypoint]:
    """The test path of Probst (2024), table 5.1, in the base frame of the robot (corrected)."""
    corners = [(350, 450, 180), (550, 450, 90), (550, -450, 0), (350, -450, 90), (350, 450, 180)]
    return [Waypoint(np.array([x, y, 400.0]), np.array([alpha, 0.0, 90.0])) for x, y, alpha in corners]


@dataclass
class _ThroughWaypoints:
    kind: ClassVar[str]
    length: ClassVar[float] = 1.0  # of the parameter on every segment
    # In the order in which the tool passes them
    waypoints: list[Waypoint] = field(default_factory=rectangle_waypoints)

    def segments(self) -> list[Segment]:
        """The pieces of the path. Raises ValueError if the way points are impossible."""
        if len(self.waypoints) == 0:
            raise ValueError(f"reference: path '{self.kind}' needs at least one waypoint, got none")
        for number, waypoint in enumerate(self.waypoints, 1):
            if not isinstance(waypoint, Waypoint):
                raise ValueError(f"reference: waypoint {number} must be a Waypoint, got {waypoint!r}")
            require_vectors(f"waypoint {number}", waypoint, "translation_mm", "zyx_deg")
        poses = [waypoint.pose() for waypoint in self.waypoints]
        if len(poses) == 1:  # a pose that is held for as long as a segment takes
            poses *= 2
        return [line(start, end) for start, end in pairwise(poses)]


@dataclass
class Rectangle(_ThroughWaypoints):
    """Through way points without a rest, by default the test path of Probst (2024); one point is held."""

    kind: ClassVar[str] = "rectangle"
    rests: ClassVar[bool] = False  # whether the tool rests at every way point, for as long as at the end


@dataclass
class Points(_ThroughWaypoints):
    """Through way points with a rest at each."""

    kind: ClassVar[str] = "points"
    rests: ClassVar[bool] = True
