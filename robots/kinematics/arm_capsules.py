"""The arm as capsules along its links, placed by the joint positions: what hides, and what may hit."""

from dataclasses import dataclass

import numpy as np

from robots.description.model import RobotModel
from robots.kinematics.forward import rotation_about

_SHORTEST = 1e-6  # m, a link without length has no capsule of its own


@dataclass(frozen=True)
class Capsules:
    """k capsules in the world frame: all points within ``radius`` of a segment."""

    start: np.ndarray  # m, (k, 3)
    end: np.ndarray  # m, (k, 3)
    radius: np.ndarray  # m, (k,)

    def distances(self, p_W: np.ndarray) -> np.ndarray:
        """Distances in m of points (n, 3) from the nearest surface, (n,); negative within a capsule."""
        found = np.full(len(p_W), np.inf)
        for start, end, radius in zip(self.start, self.end, self.radius, strict=True):
            along, from_start = end - start, p_W - start
            share = np.clip(from_start @ along / max(along @ along, _SHORTEST**2), 0.0, 1.0)
            gap = from_start - share[:, None] * along
            np.minimum(found, np.sqrt(np.einsum("ij,ij->i", gap, gap)) - radius, out=found)
        return found


@dataclass(frozen=True)
class ToolShape:
    """What the flange carries: a capsule along the axis of the last joint."""

    length: float  # m, beyond the flange
    radius: float  # m


class ArmCapsules:
    """From joint positions to the capsules of base and links.

    They run from joint to joint, as those that picture the robot do; the last link ends at the flange and has
    none, but what it carries may have one, the last of all.
    """

    def __init__(self, robot: RobotModel, tool: ToolShape | None = None) -> None:
        base = robot.base.pose()
        placements = [joint.placement.pose() for joint in robot.joints]
        self._R_WB, self._p_WB = base.rotation().matrix(), base.translation()
        self._R = [placement.rotation().matrix() for placement in placements]
        self._p = [placement.translation() for placement in placements]
        self._axes = robot.axes
        radius = np.array([robot.base_link.radius, *(link.radius for link in robot.links[:-1])])
        self._long = np.linalg.norm(self._p, axis=1) > _SHORTEST
        self._radius = radius[self._long]
        self._tool = tool

    def at(self, q: np.ndarray) -> Capsules:
        """The capsules in the world at joint positions q (rad, shape (6,))."""
        R, p = self._R_WB, self._p_WB
        joints = [p]
        for placement_R, placement_p, axis, angle in zip(self._R, self._p, self._axes, q, strict=True):
            p = p + R @ placement_p
            R = R @ placement_R @ rotation_about(axis, angle)
            joints.append(p)
        ends = np.array(joints)
        start, end, radius = ends[:-1][self._long], ends[1:][self._long], self._radius
        if self._tool is not None:
            tip = ends[-1] + self._tool.length * (R @ self._axes[-1])
            start, end = np.vstack([start, ends[-1]]), np.vstack([end, tip])
            radius = np.append(radius, self._tool.radius)
        return Capsules(start, end, radius)
