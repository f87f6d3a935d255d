"""Springs of gears that stiffen under load; deflections in rad, torques in N m, on the side of the link.

Parameters are numbers, or arrays that broadcast with the deflections: many springs of a kind at once.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self, cast

import numpy as np

from robots.drivetrain.monotone import monotone_inverse

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


class GearSpring(ABC):
    """An odd, increasing characteristic; arrays of any shape."""

    invertible: ClassVar[bool] = True
    c_0: float | np.ndarray  # N m / rad, at rest

    @abstractmethod
    def torque(self, deflection: np.ndarray) -> np.ndarray:
        """Torques in N m that a deflection in rad takes."""

    @abstractmethod
    def stiffness(self, deflection: np.ndarray) -> np.ndarray:
        """Tangent d(torque) / d(deflection) in N m / rad."""

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """A spring that takes ``factor`` times the torque at every deflection."""

    def deflection(self, torque: np.ndarray) -> np.ndarray:
        """The inverse of `torque`, to rounding."""
        torque = np.asarray(torque, dtype=float)
        guess = np.maximum(np.abs(torque), 1e-12) / self.c_0
        return monotone_inverse(self.torque, self.stiffness, torque, guess)

    def energy(self, deflection: np.ndarray) -> np.ndarray:
        """Energy stored in J, by Gauss-Legendre quadrature of the torque."""
        half = 0.5 * np.asarray(deflection, dtype=float)
        return half * np.tensordot(_WEIGHTS, self.torque(np.multiply.outer(1.0 + _NODES, half)), 1)

    def _refuse(self, **values: float) -> None:
        for label, value in values.items():
            if not np.all(np.greater(value, 0.0)):
                raise ValueError(f"{type(self).__name__}: {label} must be positive, got {value}")


@dataclass(frozen=True)
class CubicSpring(GearSpring):
    """c_0 phi (1 + gamma phi^2), Reiner (2010) eq. (2.7)."""

    c_0: float  # N m / rad
    gamma: float  # 1 / rad^2

    def __post_init__(self) -> None:
        self._refuse(c_0=self.c_0)
        if not np.all(np.greater_equal(self.gamma, 0.0)):
            raise ValueError(f"CubicSpring: gamma must not be negative, got {self.gamma}")

    def torque(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.torque`."""
        return self.c_0 * deflection * (1.0 + self.gamma * np.square(deflection))

    def stiffness(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.stiffness`."""
        return self.c_0 * (1.0 + 3.0 * self.gamma * np.square(deflection))

    def scaled(self, factor: float) -> Self:
        """See `GearSpring.scaled`."""
        return replace(self, c_0=factor * self.c_0)


@dataclass(frozen=True)
class ExponentialSpring(GearSpring):
    """phi (c_0 + (c_max - c_0) (1 - exp(-gamma |phi|))), Reiner (2010) eq. (2.8)."""

    c_0: float  # N m / rad at rest
    c_max: float  # N m / rad at infinite load
    gamma: float  # 1 / rad

    def __post_init__(self) -> None:
        self._refuse(c_0=self.c_0, gamma=self.gamma)
        if not np.all(np.greater_equal(self.c_max, self.c_0)):
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

    def scaled(self, factor: float) -> Self:
        """See `GearSpring.scaled`."""
        return replace(self, c_0=factor * self.c_0, c_max=factor * self.c_max)


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
        if not np.all(np.greater(self.c_max, self.c_0)):
            raise ValueError(f"LimitedSpring: c_max must be above c_0, got {self.c_max} and {self.c_0}")

    def _secant(self, deflection: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The secant stiffness, that of the cubic spring, and what share of the latter is in the former."""
        c, s = self.c_0 * (1.0 + self.gamma * np.square(deflection)), self.sharpness
        beyond = np.arctan((c - self.c_max) * s) / np.pi
        share = np.arctan(c * s) / np.pi - beyond
        return c * share + self.c_max * (beyond + 0.5), c, share

    def torque(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.torque`."""
        return deflection * self._secant(deflection)[0]

    def stiffness(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.stiffness`."""
        secant, c, share = self._secant(deflection)
        s = self.sharpness
        # The derivative of the secant stiffness by the cubic spring's.
        change = share + s / np.pi * (c / (1.0 + np.square(c * s)))
        change += s / np.pi * (self.c_max - c) / (1.0 + np.square((c - self.c_max) * s))
        return secant + 2.0 * self.c_0 * self.gamma * np.square(deflection) * change

    def scaled(self, factor: float) -> Self:
        """See `GearSpring.scaled`."""
        c_0, c_max = factor * self.c_0, factor * self.c_max
        return replace(self, c_0=c_0, c_max=c_max, sharpness=self.sharpness / factor)


class SpringRow(GearSpring):
    """Springs side by side, each with its own characteristic; arrays of shape (..., number of springs)."""

    def __init__(self, springs: Sequence[GearSpring]) -> None:
        """Takes the springs in their order."""
        self.springs = tuple(springs)
        self.c_0 = np.array([spring.c_0 for spring in springs])
        # Springs of one kind are evaluated at once, as one spring whose parameters are arrays.
        self._groups: list[tuple[np.ndarray, GearSpring]] = []
        for kind in dict.fromkeys(type(spring) for spring in springs):
            where = np.array([i for i, spring in enumerate(springs) if type(spring) is kind])
            names = [entry.name for entry in fields(cast(Any, kind))]
            values = {name: np.array([getattr(springs[i], name) for i in where]) for name in names}
            self._groups.append((where, kind(**values)))

    def torque(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.torque`."""
        return self._each(lambda spring, x: spring.torque(x), deflection)

    def stiffness(self, deflection: np.ndarray) -> np.ndarray:
        """See `GearSpring.stiffness`."""
        return self._each(lambda spring, x: spring.stiffness(x), deflection)

    def scaled(self, factor: float) -> Self:
        """See `GearSpring.scaled`."""
        return type(self)([spring.scaled(factor) for spring in self.springs])

    def _each(
        self, value: Callable[[GearSpring, np.ndarray], np.ndarray], deflection: np.ndarray
    ) -> np.ndarray:
        if len(self._groups) == 1:
            return value(self._groups[0][1], deflection)
        values = np.empty_like(deflection)
        for where, spring in self._groups:
            values[..., where] = value(spring, deflection[..., where])
        return values
