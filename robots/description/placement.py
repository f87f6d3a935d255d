"""A frame in another one as a robot file says it, and what pictures a body."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from robots.configuration.quantity import choice, numbers
from robots.pose import rotation_from_zyx, zyx_from_rotation

SHAPES = {"mesh": 3, "box": 3, "cylinder": 2, "sphere": 1}  # and how many numbers say their size


@dataclass
class Placement:
    """A frame in its parent: translation in m, ZYX Euler angles (alpha, beta, gamma) in degrees."""

    # m, of the origin, along the axes of the parent
    translation: np.ndarray = field(default_factory=lambda: np.zeros(3))
    # Alpha, beta, gamma: turned about z, then the new y, then the new x
    zyx_deg: np.ndarray = field(default_factory=lambda: np.zeros(3))
    source: str = ""  # where the numbers come from, or ``assumed``

    def pose(self) -> RigidTransform:
        """The placement as a transform, child in parent."""
        R = RotationMatrix(rotation_from_zyx(np.deg2rad(self.zyx_deg)))
        return RigidTransform(R, self.translation)


@dataclass
class Picture:
    """A shape that a viewer shows for a link, in place of a capsule."""

    shape: str = choice("mesh", SHAPES)  # what is drawn
    file: str = ""  # of a mesh: .obj, .gltf, .glb, .dae or .stl
    # m: edges of a box, radius and length of a cylinder, radius of a sphere; factors of a mesh along x, y, z
    size: list[float] = numbers([1.0, 1.0, 1.0], (1, 2, 3))
    placement: Placement = field(default_factory=Placement)  # in the frame of the link

    def problem(self) -> str:
        """Why there is no such shape, or an empty string."""
        if len(self.size) != SHAPES[self.shape]:
            return f"the size of a {self.shape} needs {SHAPES[self.shape]} numbers, got {self.size}"
        if self.shape == "mesh" and not self.file:
            return "a mesh needs a file"
        return ""


def placement_entry(X: RigidTransform, source: str) -> dict:
    """What a robot file says of a transform, child in parent."""
    angles = np.rad2deg(zyx_from_rotation(X.rotation().matrix()))
    # Rounded to what the arithmetic has: zeros come out as such.
    return {
        "translation": (np.round(X.translation(), 15) + 0.0).tolist(),
        "zyx_deg": (np.round(angles, 13) + 0.0).tolist(),
        "source": source,
    }
