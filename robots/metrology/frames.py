"""A frame from three measured points, by Gram-Schmidt.

K is the frame that the points define, D the device that measures them (a measuring arm, a camera system,
or the robot with a tip). A pose X_DK is the frame seen by the device; seen from one device, two frames
give X_KL = X_DK^-1 X_DL, in which the device no longer occurs.
"""

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from robots.metrology.least_squares import UndeterminedError

MINIMUM_ANGLE = np.deg2rad(5.0)  # between the arms of a frame; below, its plane is guesswork
MINIMUM_ARM = 1e-3  # m, from the origin of a frame to a point on an axis; shorter ones are wrong units


@dataclass(frozen=True)
class ThreePointFrame:
    """A frame by Gram-Schmidt; ``skew`` is how far its arms were from a right angle, in rad."""

    X_DK: RigidTransform
    skew: float


def three_point_frame(points: np.ndarray) -> ThreePointFrame:
    """The frame of an origin, a point on its x axis and one on its y axis, Wilms (2016), chapter 1.

    The x axis is exact, the y axis is made orthogonal to it, z follows. Three points are never
    left-handed; a fourth one, anywhere on the side of positive z, shows whether x and y were exchanged.

    Args:
        points: origin, x, y and, if wanted, the point of positive z, in m, shape (3, 3) or (4, 3).

    Raises:
        UndeterminedError: if points coincide, lie on a line or are left-handed.
        ValueError: if there are not three or four points.
    """
    points = np.asarray(points, dtype=float)
    if points.shape not in ((3, 3), (4, 3)):
        raise ValueError(f"a frame takes three points (origin, x, y) or four (and z), got {len(points)}")
    arms = points[1:] - points[0]
    lengths = np.linalg.norm(arms, axis=1)
    for row, (name, length) in enumerate(zip("xyz", lengths, strict=False), 1):
        if length < MINIMUM_ARM:
            raise UndeterminedError(
                f"point {name} is {1e3 * length:.3g} mm from the origin, must be at least "
                f"{1e3 * MINIMUM_ARM:g} mm (is the unit right?)",
                [row],
            )
    x = arms[0] / lengths[0]
    across = arms[1] - (arms[1] @ x) * x
    angle = np.arctan2(np.linalg.norm(across), arms[1] @ x)
    if np.sin(angle) < np.sin(MINIMUM_ANGLE):
        raise UndeterminedError(
            f"origin, x and y are collinear: {np.rad2deg(angle):.3g} degrees between the arms, must be "
            f"{np.rad2deg(MINIMUM_ANGLE):g} to {180.0 - np.rad2deg(MINIMUM_ANGLE):g}",
            [0, 1, 2],
        )
    y = across / np.linalg.norm(across)
    z = np.cross(x, y)
    if len(arms) == 3 and not arms[2] @ z > 0.0:
        raise UndeterminedError(
            f"left-handed: the point of positive z lies {-1e3 * (arms[2] @ z):.3g} mm below the x-y plane "
            "(are x and y exchanged?)",
            [3],
        )
    X_DK = RigidTransform(RotationMatrix(np.column_stack([x, y, z])), points[0])
    return ThreePointFrame(X_DK, float(angle - 0.5 * np.pi))
