"""A spring that carries part of the arm's weight at axis 2."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np


@dataclass(frozen=True)
class Counterbalance:
    """A tension spring between the base and the upper arm, Reiner (2010) section 2.5, without its own mass.

    It pulls a point of the arm, at ``arm_radius`` from the axis, to a point of the base at ``base_radius``,
    which may be beside it along the axis. At the position ``dead_centre_deg`` both are on one side of the
    axis: there it is shortest and turns nothing.
    """

    stiffness: float  # N / m
    preload: float  # N at the dead centre
    base_radius: float  # m
    arm_radius: float  # m
    dead_centre_deg: float = 0.0
    lateral: float = 0.0  # m between the points along the axis
    damping: float = 0.0  # N s / m, along the spring

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for label in ("stiffness", "base_radius", "arm_radius"):
            if not getattr(self, label) > 0.0:
                raise ValueError(f"Counterbalance: {label} must be positive, got {getattr(self, label)}")
        for label in ("preload", "lateral", "damping"):
            if not getattr(self, label) >= 0.0:
                raise ValueError(f"Counterbalance: {label} must not be negative, got {getattr(self, label)}")
        if not self.shortest > 0.0:
            raise ValueError(
                f"Counterbalance: the radii must differ, got {self.base_radius} m and {self.arm_radius} m"
            )

    @property
    def shortest(self) -> float:
        """Its length at the dead centre in m."""
        return float(np.hypot(self.base_radius - self.arm_radius, self.lateral))

    def _length(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The spring's length in m and its derivative by q."""
        angle = np.asarray(q) - np.deg2rad(self.dead_centre_deg)
        a, b = self.base_radius, self.arm_radius
        length = np.sqrt(a * a + b * b - 2.0 * a * b * np.cos(angle) + self.lateral**2)
        return length, a * b * np.sin(angle) / length

    def torque(self, q: np.ndarray, velocity: np.ndarray | float = 0.0) -> np.ndarray:
        """Torques about the axis in N m at positions in rad and velocities in rad/s.

        The spring pulls back towards the dead centre, the damper against the motion.
        """
        length, lever = self._length(q)
        pull = self.preload + self.stiffness * (length - self.shortest)
        return -(pull + self.damping * lever * velocity) * lever

    def energy(self, q: np.ndarray) -> np.ndarray:
        """Energy stored beyond that at the dead centre, in J."""
        stretch = self._length(q)[0] - self.shortest
        return self.preload * stretch + 0.5 * self.stiffness * stretch**2
