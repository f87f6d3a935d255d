"""Springs of gears that stiffen under load; deflections in rad, torques in N m, on the side of the link."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robots.drivetrain.monotone import monotone_inverse

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


class GearSpring(ABC):
    """An odd, increasing characteristic; arrays of any shape."""

    invertible: ClassVar[bool] = True
    c_0: float  # N m / rad, at rest

    @abstractmethod
    def torque(self, deflection: np.ndarray) -> np.ndarray:
        """Torques in N m that a deflection in rad takes."""

    @abstractmethod
    def stiffness(self, deflection: np.ndarray) -> np.ndarray:
        """Tangent d(torque) / d(deflection) in N m / rad."""

    def deflection(self, torque: np.ndarray) -> np.ndarray:
        """The inverse of `torque`, to rounding."""
        torque = np.asarray(torque, dtype=float)
        guess = np.maximum(np.abs(torque), 1e-12) / self.c_0
        return monotone_inverse(self.torque, self.stiffness, torque, guess)

    def energy(self, deflection: np.ndarray) -> np.ndarray:
        """Energy stored in J, by Gauss-Legendre quadrature of the torque."""
        half = 0.5 * np.asarray(deflection, dtype=float)
        return half * np.sum(_WEIGHTS * self.torque(half[..., None] * (1.0 + _NODES)), axis=-1)

    def _refuse(self, **values: float) -> None:
        for label, value in values.items():
            if not value > 0.0:
                raise ValueError(f"{type(self).__name__}: {label} must be positive, got {value}")


@dataclass(frozen=True)
class CubicSpring(GearSpring):
    """c_0 phi (1 + gamma phi^2), Reiner (2010) eq. (2.7)."""

    c_0: float  # N m / rad
    gamma: float  # 1 / rad^2

    def __post_init__(self) -> None:
        self._refuse(c_0=self.c_0)
        if self.gamma < 0.0:
            raise ValueError(f"CubicSpring: gamma must not be negative, got {self.gamma}")

    def torque(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.torque`."""
        return self.c_0 * deflection * (1.0 + self.gamma * np.square(deflection))

    def stiffness(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.stiffness`."""
        return self.c_0 * (1.0 + 3.0 * self.gamma * np.square(deflection))


@dataclass(frozen=True)
class ExponentialSpring(GearSpring):
    """phi (c_0 + (c_max - c_0) (1 - exp(-gamma |phi|))), Reiner (2010) eq. (2.8)."""

    c_0: float  # N m / rad at rest
    c_max: float  # N m / rad at infinite load
    gamma: float  # 1 / rad

    def __post_init__(self) -> None:
        self._refuse(c_0=self.c_0, gamma=self.gamma)
        if not self.c_max >= self.c_0:
            raise ValueError(
                f"ExponentialSpring: c_max must be at least c_0, got {self.c_max} and {self.c_0}"
            )

    def torque(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.torque`."""
        decay = np.exp(-self.gamma * np.abs(deflection))
        return deflection * (self.c_0 + (self.c_max - self.c_0) * (1.0 - decay))

    def stiffness(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.stiffness`."""
        x = self.gamma * np.abs(deflection)
        return self.c_0 + (self.c_max - self.c_0) * (1.0 + (x - 1.0) * np.exp(-x))


@dataclass(frozen=True)
class LimitedSpring(GearSpring):
    """A `CubicSpring` whose secant stiffness stays below c_max, Reiner (2010) eq. (2.9).

    The tangent is larger on the way there: it peaks at 3 c_max - 2 c_0 for a sharp limit.
    """

    c_0: float  # N m / rad at rest
    gamma: float  # 1 / rad^2
    c_max: float  # N m / rad, of the secant
    sharpness: float  # rad / (N m), of the limit

    def __post_init__(self) -> None:
        self._refuse(c_0=self.c_0, gamma=self.gamma, sharpness=self.sharpness)
        if not self.c_max > self.c_0:
            raise ValueError(f"LimitedSpring: c_max must be above c_0, got {self.c_max} and {self.c_0}")

    def _secant(self, deflection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The secant stiffness and its derivative by the cubic spring's secant stiffness."""
        c, s = self.c_0 * (1.0 + self.gamma * np.square(deflection)), self.sharpness
        beyond, above = np.arctan((c - self.c_max) * s) / np.pi, np.arctan(c * s) / np.pi
        d_beyond = s / np.pi / (1.0 + np.square((c - self.c_max) * s))
        d_above = s / np.pi / (1.0 + np.square(c * s))
        secant = c - c * (beyond + 1.0 - above) + self.c_max * (beyond + 0.5)
        return secant, 1.0 - (beyond + 1.0 - above) - c * (d_beyond - d_above) + self.c_max * d_beyond

    def torque(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.torque`."""
        return deflection * self._secant(deflection)[0]

    def stiffness(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.stiffness`."""
        secant, change = self._secant(deflection)
        return secant + 2.0 * self.c_0 * self.gamma * np.square(deflection) * change
