"""The spring that carries part of the arm's weight at axis 2, as two pivots on the robot.

Reiner (2010), section 2.5, without the spring's own mass. A spring beside the middle of the axis, or one that
leans along it, also pulls the structure sideways, which the plant feels.
"""

from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform

from robots.drivetrain.counterbalance import Counterbalance


@dataclass
class CounterbalanceSpring:
    """A tension spring from link 1 to link 2, with a damper along it."""

    stiffness: float = 0.0  # N / m
    preload: float = 0.0  # N where it is shortest
    damping: float = 0.0  # N s / m
    base_pivot: np.ndarray = field(default_factory=lambda: np.zeros(3))  # m, in the frame of link 1
    arm_pivot: np.ndarray = field(default_factory=lambda: np.zeros(3))  # m, in the frame of link 2
    source: str = ""  # where the numbers come from, or ``assumed``

    def about_axis(self, axis: np.ndarray, X_1S: RigidTransform) -> Counterbalance:
        """The torque that the spring of a rigid robot exerts about axis 2.

        Args:
            axis: unit vector of joint 2 in the frame of link 2, shape (3,).
            X_1S: where link 2 is at zero joint angle, in the frame of link 1.

        Raises:
            ValueError: if the pivots or the spring are impossible.
        """
        p_base, p_arm = X_1S.inverse().multiply(self.base_pivot), self.arm_pivot
        if not self.damping >= 0.0:
            raise ValueError(f"counterbalance: damping must not be negative, got {self.damping} N s/m")
        base, arm = p_base - axis * (axis @ p_base), p_arm - axis * (axis @ p_arm)
        dead_centre = np.arctan2(axis @ np.cross(arm, base), arm @ base)
        part = Counterbalance(
            self.stiffness,
            self.preload,
            float(np.linalg.norm(base)),
            float(np.linalg.norm(arm)),
            float(np.rad2deg(dead_centre)),
            abs(float(axis @ (p_base - p_arm))),
            self.damping,
        )
        if not free_length(part) > 0.0:
            raise ValueError(
                f"counterbalance: preload must be below stiffness times the shortest length, "
                f"{self.stiffness * part.shortest:g} N, got {self.preload:g} N"
            )
        return part


def free_length(part: Counterbalance) -> float:
    """The length in m at which the spring would pull no more."""
    return part.shortest - part.preload / part.stiffness
