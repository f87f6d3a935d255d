"""A spring that carries part of the arm's weight at axis 2."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np


@dataclass(frozen=True)
class Counterbalance:
    """A tension spring between the base and the upper arm, Reiner (2010) section 2.5, without its own mass.

    It pulls a point of the arm, at ``arm_radius`` from the axis, to a point of the base at ``base_radius``.
    At the position ``dead_centre_deg`` both are on one side of the axis: there it is shortest and turns
    nothing.
    """

    stiffness: float  # N / m
    preload: float  # N at the dead centre
    base_radius: float  # m
    arm_radius: float  # m
    dead_centre_deg: float = 0.0

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for label in ("stiffness", "base_radius", "arm_radius"):
            if not getattr(self, label) > 0.0:
                raise ValueError(f"Counterbalance: {label} must be positive, got {getattr(self, label)}")
        if self.preload < 0.0 or self.base_radius == self.arm_radius:
            raise ValueError(
                "Counterbalance: preload must not be negative and the radii must differ, got "
                f"{self.preload} N, {self.base_radius} m and {self.arm_radius} m"
            )

    def _length(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The spring's length in m and its derivative by q."""
        angle = np.asarray(q) - np.deg2rad(self.dead_centre_deg)
        a, b = self.base_radius, self.arm_radius
        length = np.sqrt(a * a + b * b - 2.0 * a * b * np.cos(angle))
        return length, a * b * np.sin(angle) / length

    def torque(self, q: np.ndarray) -> np.ndarray:
        """Torques about the axis in N m at positions in rad, back towards the dead centre."""
        length, lever = self._length(q)
        stretch = length - abs(self.base_radius - self.arm_radius)
        return -(self.preload + self.stiffness * stretch) * lever

    def energy(self, q: np.ndarray) -> np.ndarray:
        """Energy stored beyond that at the dead centre, in J."""
        stretch = self._length(q)[0] - abs(self.base_radius - self.arm_radius)
        return self.preload * stretch + 0.5 * self.stiffness * stretch**2
