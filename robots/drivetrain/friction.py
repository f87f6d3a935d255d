"""Friction of drive trains: viscous and Coulomb, smooth through zero, with Stribeck effect, or as measured.

Velocities are in rad/s and torques in N m on the same side of the gear; all methods take arrays of any shape.
A friction torque acts against the motion: what is returned has the sign of the velocity.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np


def _refuse_negative(part: object, **values: float) -> None:
    for label, value in values.items():
        if not np.all(np.greater_equal(value, 0.0)):
            raise ValueError(f"{type(part).__name__}: {label} must not be negative, got {value}")


def _refuse_not_positive(part: object, **values: float) -> None:
    for label, value in values.items():
        if not np.all(np.greater(value, 0.0)):
            raise ValueError(f"{type(part).__name__}: {label} must be positive, got {value}")


@dataclass(frozen=True)
class SigmoidFriction:
    """Viscous friction and a sigmoid of Coulomb friction, Reiner (2010) eq. (2.3).

    2 h / (1 + exp(-s v)) - h is h tanh(s v / 2), which does not overflow.
    """

    viscous: float  # N m s / rad
    coulomb: float  # N m
    steepness: float  # s / rad, of the passage through zero

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _refuse_negative(self, viscous=self.viscous, coulomb=self.coulomb)
        _refuse_not_positive(self, steepness=self.steepness)

    def torque(self, velocity: np.ndarray) -> np.ndarray:
        """Friction torques in N m."""
        return self.viscous * velocity + self.coulomb * np.tanh(0.5 * self.steepness * velocity)

    def slope(self, velocity: np.ndarray) -> np.ndarray:
        """d(torque) / d(velocity) in N m s / rad."""
        tanh = np.tanh(0.5 * self.steepness * velocity)
        return self.viscous + 0.5 * self.coulomb * self.steepness * (1.0 - tanh**2)


@dataclass(frozen=True)
class TanhFriction:
    """Viscous friction and tanh of Coulomb friction, Probst (2024) eqs. (2.63), (2.64)."""

    viscous: float  # N m s / rad
    coulomb: float  # N m
    width: float  # rad/s, velocity at which tanh is 0.76

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _refuse_negative(self, viscous=self.viscous, coulomb=self.coulomb)
        _refuse_not_positive(self, width=self.width)

    def torque(self, velocity: np.ndarray) -> np.ndarray:
        """Friction torques in N m."""
        return self.viscous * velocity + self.coulomb * np.tanh(velocity / self.width)

    def slope(self, velocity: np.ndarray) -> np.ndarray:
        """d(torque) / d(velocity) in N m s / rad."""
        return self.viscous + self.coulomb / self.width * (1.0 - np.tanh(velocity / self.width) ** 2)


@dataclass(frozen=True)
class StribeckFriction:
    """A `SigmoidFriction` with the hump of the Stribeck effect, Reiner (2010) eq. (2.4), corrected.

    The hump is v / (a v^2 + c), odd and without a pole; the printed v / (a v + c) is neither. It is highest
    at v = sqrt(c / a), where it is 1 / (2 sqrt(a c)).
    """

    base: SigmoidFriction
    a: float  # s^2 / (N m rad)
    c: float  # 1 / (N m s) rad

    invertible: ClassVar[bool] = True  # given the velocity; a torque can belong to three velocities

    def __post_init__(self) -> None:
        _refuse_not_positive(self, a=self.a, c=self.c)

    def torque(self, velocity: np.ndarray) -> np.ndarray:
        """Friction torques in N m."""
        return self.base.torque(velocity) + velocity / (self.a * np.square(velocity) + self.c)

    def slope(self, velocity: np.ndarray) -> np.ndarray:
        """d(torque) / d(velocity) in N m s / rad."""
        squared = self.a * np.square(velocity)
        return self.base.slope(velocity) + (self.c - squared) / np.square(squared + self.c)


@dataclass(frozen=True)
class PolynomialFriction:
    """A measured curve in three parts, Reiner (2010) eq. (2.5): a sigmoid, a cubic, a straight line.

    The cubic between the velocities ``step`` and 1 rad/s is the one that continues both neighbours in value
    and slope; the source gives its coefficients as parameters and demands the same of them.
    """

    coulomb: float  # N m, of the sigmoid
    steepness: float  # s / rad, of the sigmoid
    step: float  # rad/s, where the sigmoid ends, below 1
    torque_at_one: float  # N m at 1 rad/s
    slope_at_one: float  # N m s / rad from 1 rad/s on

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _refuse_not_positive(self, coulomb=self.coulomb, steepness=self.steepness, step=self.step)
        _refuse_negative(self, slope_at_one=self.slope_at_one)
        if not self.step < 1.0:
            raise ValueError(f"PolynomialFriction: step must be below 1 rad/s, got {self.step}")
        cubic = self.coefficients
        turns = np.roots(np.polyder(cubic))
        speeds = np.array(
            [1.0, *turns.real[(turns.imag == 0.0) & (turns.real > self.step) & (turns.real < 1.0)]]
        )
        least = np.polyval(cubic, speeds).min()
        if least < 0.0:
            raise ValueError(
                "PolynomialFriction: the cubic between step and 1 rad/s must not drive the motion, "
                f"got {least:.4g} N m at {speeds[np.argmin(np.polyval(cubic, speeds))]:.4g} rad/s"
            )

    def _sigmoid(self) -> SigmoidFriction:
        return SigmoidFriction(0.0, self.coulomb, self.steepness)

    @property
    def coefficients(self) -> np.ndarray:
        """Coefficients of the cubic, the highest power first, shape (4,)."""
        s, sigmoid = self.step, self._sigmoid()
        rows = np.array([[s**3, s**2, s, 1.0], [3 * s**2, 2 * s, 1.0, 0.0], [1, 1, 1, 1], [3, 2, 1, 0]])
        ends = [float(sigmoid.torque(np.array(s))), float(sigmoid.slope(np.array(s)))]
        return np.linalg.solve(rows, [*ends, self.torque_at_one, self.slope_at_one])

    def torque(self, velocity: np.ndarray) -> np.ndarray:
        """Friction torques in N m."""
        speed = np.abs(velocity)
        line = self.torque_at_one + self.slope_at_one * (speed - 1.0)
        middle = np.polyval(self.coefficients, speed)
        found = np.where(
            speed > 1.0, line, np.where(speed >= self.step, middle, self._sigmoid().torque(speed))
        )
        return np.sign(velocity) * found

    def slope(self, velocity: np.ndarray) -> np.ndarray:
        """d(torque) / d(velocity) in N m s / rad."""
        speed = np.abs(velocity)
        middle = np.polyval(np.polyder(self.coefficients), speed)
        near = self._sigmoid().slope(speed)
        return np.where(speed > 1.0, self.slope_at_one, np.where(speed >= self.step, middle, near))


@dataclass(frozen=True)
class StickSlipFriction:
    """Friction that holds: at rest it balances what is applied, up to a breakaway torque, Reiner (2010) 2.2.

    For forward models only: at rest the torque does not follow from the motion. `step` is for time stepping
    with the direction of slip as its state; `holding` for integrators, without a state.
    """

    viscous: float  # N m s / rad
    coulomb: float  # N m, while slipping
    breakaway: float  # N m, at least as large
    stribeck_velocity: float = 0.01  # rad/s, over which the breakaway torque falls to the Coulomb torque
    stopping_time: float = 2e-3  # s, in which `holding` takes what is left of the velocity away

    invertible: ClassVar[bool] = False

    def __post_init__(self) -> None:
        _refuse_negative(self, viscous=self.viscous, coulomb=self.coulomb)
        _refuse_not_positive(self, stribeck_velocity=self.stribeck_velocity, stopping_time=self.stopping_time)
        if np.any(np.less(self.breakaway, self.coulomb)):
            raise ValueError(
                "StickSlipFriction: breakaway must be at least coulomb, got "
                f"{self.breakaway} and {self.coulomb}"
            )

    def step(
        self, velocity: np.ndarray, applied: np.ndarray, direction: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Friction torques for the next step, and the state.

        A slipping joint whose velocity has changed its sign since the last step has been at rest in between:
        it sticks, unless the breakaway torque cannot hold it.

        Args:
            velocity: rad/s.
            applied: all other torques in N m.
            direction: of slip at the last step: 1 or -1, 0 for a joint that sticks.

        Returns:
            Torques in N m against the motion, and the new directions. A joint that sticks is to be taken for
            at rest, whatever the last step has left of its velocity.
        """
        has_stopped = velocity * direction <= 0.0
        sticks = has_stopped & (np.abs(applied) <= self.breakaway)
        direction = np.where(sticks, 0.0, np.where(has_stopped, np.sign(applied), direction))
        slipping = self.viscous * velocity + self._sliding(velocity) * direction
        return np.where(sticks, applied, slipping), direction

    def holding(self, velocity: np.ndarray, applied: np.ndarray, inertia: np.ndarray) -> np.ndarray:
        """Friction torques in N m as a function of the motion and of what is applied.

        The torque that takes the velocity away within the stopping time and balances what drives the motion,
        as far as friction reaches: where it does, a joint comes to rest and stays there without creeping.
        It never drives the motion, and once the velocity changes its sign it holds.

        Args:
            velocity: rad/s.
            applied: all other torques in N m.
            inertia: kg m^2, which they accelerate.
        """
        driving = np.where(applied * velocity >= 0.0, applied, 0.0)
        needed = driving + inertia / self.stopping_time * velocity
        limit = self._sliding(velocity)
        return np.clip(needed, -limit, limit) + self.viscous * velocity

    def _sliding(self, velocity: np.ndarray) -> np.ndarray:
        fall = np.exp(-np.square(velocity / self.stribeck_velocity))
        return self.coulomb + (self.breakaway - self.coulomb) * fall


# What holds a joint against the rest is last.
Friction = SigmoidFriction | TanhFriction | StribeckFriction | PolynomialFriction | StickSlipFriction
