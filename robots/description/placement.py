"""A frame in another one as a robot file says it."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from robots.configuration.quantity import vector
from robots.configuration.shortest import all_shortest
from robots.pose import rotation_from_zyx, zyx_from_rotation

LONGEST_TOOL = 5.0  # m, from the flange to the tip
_LONG_TOOL = 1.5  # m; longer ones are rare, and 2 mm taken for metres are among them


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


def tool_problem(tool: Placement) -> str:
    """Why a placement is no tool; empty if it may be one."""
    length = float(np.linalg.norm(tool.translation))
    if length <= LONGEST_TOOL:
        return ""
    return f"tool.translation is {length:g} m long, more than {LONGEST_TOOL:g} m; is it in m?"


def long_tool_note(tool: Placement) -> str:
    """A tool so long that it may be in mm, in words; empty for any other."""
    length = float(np.linalg.norm(tool.translation))
    return f"the tool in the robot file is {length:.3g} m long; is it in m?" if length > _LONG_TOOL else ""


def placement_entry(X: RigidTransform, source: str) -> dict:
    """What a robot file says of a transform, child in parent."""
    angles = np.rad2deg(zyx_from_rotation(X.rotation().matrix()))
    return {
        "translation": all_shortest(X.translation(), 1e-15),
        "zyx_deg": all_shortest(angles, 1e-13),
        "source": source,
    }
