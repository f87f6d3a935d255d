"""The size of a robot, its front, and positions in the middle of its workspace, whatever its geometry."""

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.arm_structure import seen_from_base
from robots.kinematics.forward import Kinematics

_AT_ORIGIN = 1e-6  # m
_SAMPLES = 4096  # configurations among which the best are looked for
_APART = 0.6  # rad, of two candidates in one joint at least
_MARGIN = 0.3  # share of half a range that a joint should be away from its limits
_RADIUS = (0.3, 0.7)  # lengths of the arm that the tool should be away from axis 1
_HEIGHT = (-0.25, 0.45)  # lengths of the arm that the tool should be above the shoulder, along axis 1


def arm_length(robot: RobotModel) -> float:
    """The length in m of the arm from axis 2 to the tool, from frame to frame."""
    offsets = [joint.placement.translation for joint in robot.joints[2:]] + [robot.tool.translation]
    return max(float(np.linalg.norm(offsets, axis=1).sum()), 1e-3)


def shoulder(robot: RobotModel) -> tuple[np.ndarray, np.ndarray]:
    """Axis 1: the point beside joint 2, and the direction towards it from the base.

    Where the base's origin is that point, the direction is that of the base's z.

    Returns:
        A point in m and a unit vector in the world, shape (3,) each.
    """
    axes, offsets, _ = seen_from_base(robot)
    X_WB = robot.base.pose()
    axis, first = X_WB.rotation() @ axes[0], X_WB @ offsets[0]
    second = X_WB @ (offsets[0] + offsets[1])
    height = float(axis @ (second - X_WB.translation()))
    if abs(height) < _AT_ORIGIN:
        height = float(axis @ X_WB.rotation().matrix()[:, 2])
    up = axis if height >= 0.0 else -axis
    return first + axis * float(axis @ (second - first)), up


def front(robot: RobotModel, p_W: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A frame in the shoulder with z along axis 1 and x towards a point.

    Args:
        robot: whose shoulder it is.
        p_W: the point in the world in m, shape (3,), not on axis 1.

    Returns:
        Its origin (3,) and its axes (3, 3) in the world.
    """
    origin, z = shoulder(robot)
    across = p_W - origin - z * (z @ (p_W - origin))
    x = across / np.linalg.norm(across)
    return origin, np.column_stack([x, np.cross(z, x), z])


def working_positions(robot: RobotModel, count: int = 12) -> np.ndarray:
    """Positions in which the tool can move and turn freely, the best first.

    They are well away from singularities and limits, the tool at a middle distance from axis 1 and about as
    high as the shoulder. Joints 1 and 6, which change none of this, are in the middle of their ranges.

    Args:
        robot: any.
        count: how many at most.

    Returns:
        Joint positions in rad, shape (n, 6), with n at least 1.
    """
    from scipy.stats import qmc  # here: half a second that few need

    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    is_free = lower < upper  # of a range beyond a turn nothing is left
    lower, upper = np.where(is_free, lower, robot.lower), np.where(is_free, upper, robot.upper)
    unit = qmc.Halton(NUM_JOINTS, rng=np.random.default_rng(0)).random(_SAMPLES)
    unit[:, [0, 5]] = 0.5
    q = lower + unit * (upper - lower)
    score = _score(robot, q)
    chosen: list[int] = []
    for i in np.argsort(-score):
        if all(np.abs(q[i] - q[k]).max() > _APART for k in chosen):
            chosen.append(int(i))
        if len(chosen) == count:
            break
    return q[chosen]


def dexterity(robot: RobotModel, q: np.ndarray) -> np.ndarray:
    """The smallest singular value of the Jacobian with metres over the length of the arm, (n, 6) -> (n,)."""
    J = Kinematics(robot).jacobian(q).copy()
    J[..., 3:, :] /= arm_length(robot)
    return np.linalg.svd(J, compute_uv=False)[..., -1]


def _score(robot: RobotModel, q: np.ndarray) -> np.ndarray:
    half = 0.5 * np.minimum(robot.upper - robot.lower, 2.0 * np.pi)
    margin = np.min(np.minimum(q - robot.lower, robot.upper - q)[:, 1:5] / half[1:5], axis=1)
    origin, z = shoulder(robot)
    way = (Kinematics(robot).forward(q)[:, :3, 3] - origin) / arm_length(robot)
    height = way @ z
    radius = np.linalg.norm(way - height[:, None] * z, axis=1)
    inside = _window(radius, _RADIUS) * _window(height, _HEIGHT)
    return dexterity(robot, q) * np.clip(margin / _MARGIN, 0.01, 1.0) * inside


def _window(values: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """One within limits, falling off outside."""
    away = np.maximum(np.maximum(limits[0] - values, values - limits[1]), 0.0)
    return np.exp(-np.square(away / 0.1))
