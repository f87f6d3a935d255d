"""The parts of a drive train that a robot file may name, each by its tag: ``friction: !Stribeck {...}``.

All are on the side of the link. The parts of `robots.drivetrain` are what they stand for.
"""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from robots.drivetrain import friction as kit
from robots.drivetrain.backlash import ViscoElasticGear
from robots.drivetrain.dahl import DahlHysteresis
from robots.drivetrain.efficiency import DirectionalEfficiency
from robots.drivetrain.ratio import FourierRatio as RatioSeries
from robots.drivetrain.stiffness import CubicSpring, ExponentialSpring, LimitedSpring
from robots.drivetrain.train import SoftBranch


@dataclass
class _Friction:
    """Friction of some kind."""

    torques: ClassVar[tuple[str, ...]] = ()  # fields in proportion to which it is

    def scaled(self, factor: float) -> Self:
        """The same friction, ``factor`` times as strong."""
        return replace(self, **{name: factor * getattr(self, name) for name in self.torques})


@dataclass
class Sigmoid(_Friction):
    """Viscous and Coulomb friction, Reiner (2010) eq. (2.3)."""

    viscous: float = 0.0  # N m s / rad
    coulomb: float = 0.0  # N m
    steepness: float = 200.0  # s / rad, of the passage through zero

    torques: ClassVar[tuple[str, ...]] = ("viscous", "coulomb")

    def part(self) -> kit.SigmoidFriction:
        """Raises ValueError if a number is impossible."""
        return kit.SigmoidFriction(self.viscous, self.coulomb, self.steepness)


@dataclass
class Tanh(_Friction):
    """Viscous and Coulomb friction, Probst (2024) eqs. (2.63), (2.64)."""

    viscous: float = 0.0  # N m s / rad
    coulomb: float = 0.0  # N m
    width: float = 0.01  # rad/s, velocity at which tanh is 0.76

    torques: ClassVar[tuple[str, ...]] = ("viscous", "coulomb")

    def part(self) -> kit.TanhFriction:
        """Raises ValueError if a number is impossible."""
        return kit.TanhFriction(self.viscous, self.coulomb, self.width)


@dataclass
class Stribeck(_Friction):
    """Friction with the hump of the Stribeck effect, Reiner (2010) eq. (2.4), corrected.

    The hump v / (a v^2 + c) is given by where it is highest, v = sqrt(c / a), and how high it is there.
    """

    viscous: float = 0.0  # N m s / rad
    coulomb: float = 0.0  # N m
    steepness: float = 200.0  # s / rad, of the passage through zero
    hump: float = 0.0  # N m, 1 / (2 sqrt(a c))
    hump_velocity: float = 0.02  # rad/s

    torques: ClassVar[tuple[str, ...]] = ("viscous", "coulomb", "hump")

    def part(self) -> kit.StribeckFriction:
        """Raises ValueError if a number is impossible."""
        if not (self.hump > 0.0 and self.hump_velocity > 0.0):
            raise ValueError(
                f"Stribeck: hump and hump_velocity must be positive, got {self.hump}, {self.hump_velocity}"
            )
        base = kit.SigmoidFriction(self.viscous, self.coulomb, self.steepness)
        a, c = 0.5 / (self.hump * self.hump_velocity), 0.5 * self.hump_velocity / self.hump
        return kit.StribeckFriction(base, a, c)


@dataclass
class Polynomial(_Friction):
    """A measured curve, Reiner (2010) eq. (2.5)."""

    coulomb: float = 0.0  # N m, of the sigmoid
    steepness: float = 200.0  # s / rad, of the sigmoid
    step: float = 0.05  # rad/s, where the sigmoid ends, below 1
    torque_at_one: float = 0.0  # N m at 1 rad/s
    slope_at_one: float = 0.0  # N m s / rad from 1 rad/s on

    torques: ClassVar[tuple[str, ...]] = ("coulomb", "torque_at_one", "slope_at_one")

    def part(self) -> kit.PolynomialFriction:
        """Raises ValueError if a number is impossible."""
        return kit.PolynomialFriction(
            self.coulomb, self.steepness, self.step, self.torque_at_one, self.slope_at_one
        )


@dataclass
class StickSlip(_Friction):
    """Friction that holds at rest up to a breakaway torque, Reiner (2010) section 2.2."""

    viscous: float = 0.0  # N m s / rad
    coulomb: float = 0.0  # N m, while slipping
    breakaway: float = 0.0  # N m, at least as large
    stribeck_velocity: float = 0.01  # rad/s, over which one falls to the other
    stopping_time: float = 2e-3  # s, in which the last of the velocity goes

    torques: ClassVar[tuple[str, ...]] = ("viscous", "coulomb", "breakaway")

    def part(self) -> kit.StickSlipFriction:
        """Raises ValueError if a number is impossible."""
        return kit.StickSlipFriction(
            self.viscous, self.coulomb, self.breakaway, self.stribeck_velocity, self.stopping_time
        )


@dataclass
class FourierRatio:
    """A gear whose output is ahead and behind periodically, Reiner (2010) eq. (2.6)."""

    amplitudes: list[float] = field(default_factory=list)  # rad, by which the output is off
    per_motor_turn: list[float] = field(default_factory=list)  # how often in a turn of the motor
    phases_deg: list[float] = field(default_factory=list)  # of each sine, at joint angle 0

    def part(self, ratio: float) -> RatioSeries:
        """The series of a gear with a mean ratio. Raises ValueError if its numbers are impossible."""
        frequencies = [ratio * times for times in self.per_motor_turn]
        # An input that is ahead is an output that is behind.
        amplitudes = [-a * f * ratio for a, f in zip(self.amplitudes, frequencies, strict=False)]
        if len(self.amplitudes) != len(frequencies):
            amplitudes = self.amplitudes
        phases = np.deg2rad(self.phases_deg).tolist()
        return RatioSeries(ratio, tuple(amplitudes), tuple(frequencies), tuple(phases))


@dataclass
class Efficiency:
    """What a gear loses of its load, by the direction in which power flows, Reiner (2010) eq. (2.10)."""

    forward: float = 1.0  # eta_1 at rest, in (0, 1]
    backward: float = 1.0  # eta_2 at rest, in (0, 1]
    forward_per_speed: float = 0.0  # s / rad
    backward_per_speed: float = 0.0  # s / rad
    rest_width: float = 0.01  # rad/s, over which the loss changes its sign

    def part(self) -> DirectionalEfficiency:
        """Raises ValueError if a number is impossible."""
        return DirectionalEfficiency(
            self.forward, self.backward, self.forward_per_speed, self.backward_per_speed, self.rest_width
        )


@dataclass
class Backlash:
    """Play between teeth, Reiner (2010) eq. (2.12), corrected; spring and damper are those of the gear."""

    arc_minutes: float = 0.0  # the whole play
    lubricant: float = 0.0  # N m s / rad, what damps within it


@dataclass
class ViscoElastic:
    """A smooth substitute for play, Reiner (2010) figure 2.5(b): a soft lossy branch beside the spring."""

    soft: float = 0.0  # c_2, N m / rad
    damped: float = 0.0  # c_3, N m / rad
    damping: float = 0.0  # N m s / rad, parallel to c_3

    def part(self) -> SoftBranch:
        """Raises ValueError if a number is impossible."""
        ViscoElasticGear(CubicSpring(1.0, 0.0), self.soft, self.damped, self.damping)
        return SoftBranch(self.soft, self.damped, self.damping)


@dataclass
class Dahl:
    """Hysteresis as springs in series with dry friction, beside the gear's spring; it only takes energy."""

    stiffness: list[float] = field(default_factory=list)  # of each element, as a share of that of the gear
    width: list[float] = field(default_factory=list)  # rad, how far each yields before it slips

    def part(self, c_0: float) -> DahlHysteresis:
        """The hysteresis of a gear with a stiffness in N m / rad. Raises ValueError if it is impossible."""
        return DahlHysteresis(tuple(c_0 * share for share in self.stiffness), tuple(self.width))


@dataclass
class Cubic:
    """A spring that stiffens, Reiner (2010) eq. (2.7); its c_0 is the stiffness of what it stands for."""

    gamma: float = 0.0  # 1 / rad^2

    def scaled(self, factor: float) -> "Cubic":
        """For a spring ``factor`` times as stiff at every deflection."""
        return self

    def spring(self, c_0: float) -> CubicSpring:
        """Raises ValueError if a number is impossible."""
        return CubicSpring(c_0, self.gamma)


@dataclass
class Exponential:
    """A spring that stiffens, Reiner (2010) eq. (2.8); its c_0 is the stiffness of what it stands for."""

    c_max: float = 0.0  # N m / rad at infinite load
    gamma: float = 0.0  # 1 / rad

    def scaled(self, factor: float) -> "Exponential":
        """For a spring ``factor`` times as stiff at every deflection."""
        return replace(self, c_max=factor * self.c_max)

    def spring(self, c_0: float) -> ExponentialSpring:
        """Raises ValueError if a number is impossible."""
        return ExponentialSpring(c_0, self.c_max, self.gamma)


@dataclass
class Limited:
    """A spring that stiffens up to a limit, Reiner (2010) eq. (2.9); its c_0 as of `Cubic`."""

    gamma: float = 0.0  # 1 / rad^2
    c_max: float = 0.0  # N m / rad, of the secant
    sharpness: float = 0.0  # rad / (N m), of the limit

    def scaled(self, factor: float) -> "Limited":
        """For a spring ``factor`` times as stiff at every deflection."""
        return replace(self, c_max=factor * self.c_max, sharpness=self.sharpness / factor)

    def spring(self, c_0: float) -> LimitedSpring:
        """Raises ValueError if a number is impossible."""
        return LimitedSpring(c_0, self.gamma, self.c_max, self.sharpness)
