"""A frame in another one as a robot file says it."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from robots.configuration.quantity import vector
from robots.pose import rotation_from_zyx, zyx_from_rotation


@dataclass
class Placement:
    """A frame in its parent: translation in m, ZYX Euler angles (alpha, beta, gamma) in degrees."""

    # Of the origin, along the axes of the parent; whoever writes more has written mm
    translation: np.ndarray = vector((0.0, 0.0, 0.0), -100.0, 100.0, unit="m")
    # Alpha, beta, gamma: turned about z, then the new y, then the new x
    zyx_deg: np.ndarray = field(default_factory=lambda: np.zeros(3))
    source: str = ""  # where the numbers come from, or ``assumed``

    def pose(self) -> RigidTransform:
        """The placement as a transform, child in parent."""
        R = RotationMatrix(rotation_from_zyx(np.deg2rad(self.zyx_deg)))
        return RigidTransform(R, self.translation)


def placement_entry(X: RigidTransform, source: str) -> dict:
    """What a robot file says of a transform, child in parent."""
    angles = np.rad2deg(zyx_from_rotation(X.rotation().matrix()))
    # Rounded to what the arithmetic has: zeros come out as such.
    return {
        "translation": (np.round(X.translation(), 15) + 0.0).tolist(),
        "zyx_deg": (np.round(angles, 13) + 0.0).tolist(),
        "source": source,
    }
