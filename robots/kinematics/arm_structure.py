"""How an arm is built: axes and offsets as the analytic inverse kinematics needs them, in whichever frames.

The analytic solution knows an arm whose axes point along z, y, y, x, y, x at zero joint angles, in the axes
of the base, and whose wrist is spherical. Many robots are built so and described otherwise: their base stands
on a wall, their joints have other zeros, the origins of their links are elsewhere on the axes. `aligned`
describes such a robot anew.
"""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from robots.description.model import NUM_JOINTS, Placement, RobotModel
from robots.pose import zyx_from_rotation

_TOLERANCE = 1e-9  # of direction cosines, and of lengths in m
AXES = "zyyxyx"  # the directions of the joint axes at zero joint angles
# The directions, by the number of the joint, in which its origin must not be off the one before.
FREE_OF_OFFSET = {2: "y", 3: "y", 5: "yz", 6: "yz"}


@dataclass(frozen=True)
class ArmStructure:
    """An arm that the analytic solution knows.

    Attributes:
        signs: of the axes along z, y, y, x, y, x, shape (6,).
        offsets: between the frames of the links at zero joint angles in the axes of the base, m, (6, 3).
        R_BF: rotation of the flange there, shape (3, 3).
        base: of the robot in the world.
        tool: in the frame of the flange.
        zeros: joint positions of the robot at which these joint angles are zero, rad, shape (6,).
    """

    signs: np.ndarray
    offsets: np.ndarray
    R_BF: np.ndarray
    base: RigidTransform
    tool: RigidTransform
    zeros: np.ndarray


def seen_from_base(robot: RobotModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the robot looks like at zero joint angles, in the axes of the base.

    Returns:
        The axes of the joints (6, 3), the offsets between the frames of the links (6, 3) in m, and the
        rotation of the flange (3, 3).
    """
    axes, offsets, R_BL = np.empty((NUM_JOINTS, 3)), np.empty((NUM_JOINTS, 3)), np.eye(3)
    for i, joint in enumerate(robot.joints):
        offsets[i] = R_BL @ joint.placement.translation
        R_BL = R_BL @ joint.placement.pose().rotation().matrix()
        axes[i] = R_BL @ robot.axes[i]
    return axes, offsets, R_BL


def has_spherical_wrist(robot: RobotModel) -> bool:
    """Whether the robot is built as the analytic solution needs it, however it is described."""
    try:
        arm_structure(robot)
    except ValueError:
        return False
    return True


def arm_structure(robot: RobotModel) -> ArmStructure:
    """The structure of a robot as it is described, or else of the same robot `aligned`.

    Raises:
        ValueError: if an axis or an offset is not as it must be; the message says which.
    """
    try:
        return _structure(robot)
    except ValueError as error:
        found = aligned(robot)
        if found is None:
            raise error
        other, zeros = found
        return replace(_structure(other), zeros=zeros)


def _structure(robot: RobotModel) -> ArmStructure:
    axes, offsets, R_BF = seen_from_base(robot)
    signs = np.empty(NUM_JOINTS)
    for i, letter in enumerate(AXES):
        unit = np.eye(3)["xyz".index(letter)]
        signs[i] = np.sign(unit @ axes[i])
        if np.abs(axes[i] - signs[i] * unit).max() > _TOLERANCE:
            raise ValueError(
                f"inverse kinematics of {robot.name}: the axis of joint {i + 1} must point along {letter} "
                f"at zero joint angles, got {np.round(axes[i], 6).tolist()} in the base"
            )
    for number, directions in FREE_OF_OFFSET.items():
        for letter in directions:
            length = offsets[number - 1, "xyz".index(letter)]
            if abs(length) > _TOLERANCE:
                what = "the arm must lie in a plane" if letter == "y" else "the axes of the wrist must meet"
                raise ValueError(
                    f"inverse kinematics of {robot.name}: joint {number} must have no offset along {letter}, "
                    f"got {1e3 * length:.3f} mm; {what}"
                )
    forearm = offsets[3] + offsets[4]
    if min(np.linalg.norm(offsets[2]), np.hypot(forearm[0], forearm[2])) < _TOLERANCE:
        raise ValueError(f"inverse kinematics of {robot.name}: the upper arm or the forearm has no length")
    return ArmStructure(signs, offsets, R_BF, robot.base.pose(), robot.tool.pose(), np.zeros(NUM_JOINTS))


def aligned(robot: RobotModel) -> tuple[RobotModel, np.ndarray] | None:
    """The same robot with z of its base along axis 1, y along axis 2 and a wrist that is straight at zero.

    Axis 1 must be square to axis 2, axis 2 parallel to axis 3, and each of axes 4 to 6 square to the one
    before, with one point in common. Origins are moved along their axes: those of joints 1 to 3 beside axis
    1, those of joints 4 to 6 into the centre of the wrist. All frames are parallel to the base at zero.

    Returns:
        The robot, and its zero joint angles as joint positions of the original in rad, shape (6,); None if it
        is built otherwise.
    """
    axes, offsets, _ = seen_from_base(robot)
    points = np.cumsum(offsets, axis=0)
    square = [axes[0] @ axes[1], *np.sum(axes[2:5] * axes[3:6], axis=1)]
    is_parallel = np.linalg.norm(np.cross(axes[1], axes[2])) < _TOLERANCE
    if np.abs(square).max() > _TOLERANCE or not is_parallel:
        return None
    R_BA = RotationMatrix.ProjectToRotationMatrix(
        np.column_stack([np.cross(axes[1], axes[0]), axes[1], axes[0]])
    )
    X_BA = RigidTransform(R_BA, points[0])
    zeros = _straightening(axes @ R_BA.matrix())
    directions, places, X_AF = _at(robot, zeros, X_BA.inverse())
    center = _common_point(places[3:], directions[3:])
    if center is None:
        return None
    origins = np.vstack([np.zeros(3), places[1:3] * [1.0, 0.0, 1.0], center, center, center])
    joints = [
        replace(joint, axis=axis, placement=Placement(step))
        for joint, axis, step in zip(
            robot.joints, directions, np.diff(origins, axis=0, prepend=np.zeros((1, 3))), strict=True
        )
    ]
    X_AE = X_AF @ robot.tool.pose()
    tool = _placement(RigidTransform(X_AE.rotation(), X_AE.translation() - center))
    return replace(robot, joints=joints, tool=tool, base=_placement(robot.base.pose() @ X_BA)), zeros


def _at(robot: RobotModel, q: np.ndarray, X: RigidTransform) -> tuple[np.ndarray, np.ndarray, RigidTransform]:
    """Directions (6, 3) and places (6, 3) of the axes at joint positions, and the flange, from base ``X``."""
    directions, places = np.empty((NUM_JOINTS, 3)), np.empty((NUM_JOINTS, 3))
    for i, (joint, axis) in enumerate(zip(robot.joints, robot.axes, strict=True)):
        X = X @ joint.placement.pose()
        directions[i], places[i] = X.rotation() @ axis, X.translation()
        X = X @ RigidTransform(RotationMatrix(AngleAxis(float(q[i]), axis)), np.zeros(3))
    return directions, places, X


def _straightening(axes: np.ndarray) -> np.ndarray:
    """Joint positions at which axes 4, 5, 6 point along x, y, x, by the shortest turns.

    Args:
        axes: at zero joint positions in the axes of `aligned`, shape (6, 3).
    """
    zeros, axes = np.zeros(NUM_JOINTS), axes.copy()
    for i, letter in ((2, "x"), (3, "y"), (4, "x")):
        wanted, found = np.eye(3)["xyz".index(letter)], axes[i + 1]
        angle = float(np.arctan2(axes[i] @ np.cross(found, wanted), found @ wanted))
        if abs(angle) > 0.5 * np.pi + _TOLERANCE:  # the opposite direction is nearer
            angle -= float(np.copysign(np.pi, angle))
        zeros[i] = angle
        axes[i + 1 :] = axes[i + 1 :] @ RotationMatrix(AngleAxis(angle, axes[i])).matrix().T
    return zeros


def _common_point(points: np.ndarray, directions: np.ndarray) -> np.ndarray | None:
    """Where three lines meet, or None if they do not; points and directions (3, 3)."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    center = np.linalg.solve(across.sum(axis=0), np.einsum("nij,nj->i", across, points))
    apart = np.einsum("nij,nj->ni", across, center - points)
    return center if np.linalg.norm(apart, axis=1).max() < _TOLERANCE else None


def _placement(X: RigidTransform) -> Placement:
    return Placement(X.translation(), np.rad2deg(zyx_from_rotation(X.rotation().matrix())))
