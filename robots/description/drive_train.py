"""What a robot file says of a joint: drive train of motor, gear, friction and further parts, and bearing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.configuration.quantity import numbers, positive
from robots.description.drive_parts import (
    Backlash,
    Cubic,
    Dahl,
    Efficiency,
    Exponential,
    FourierRatio,
    Limited,
    Polynomial,
    Sigmoid,
    StickSlip,
    Stribeck,
    Tanh,
    ViscoElastic,
)
from robots.drivetrain.friction import TanhFriction
from robots.drivetrain.stiffening import Stiffening
from robots.drivetrain.stiffness import CubicSpring, GearSpring
from robots.drivetrain.train import DriveTrains, JointTrain

ARC_MINUTE = np.pi / 180.0 / 60.0
# Parts beyond a linear or stiffening gear with friction (2.63), (2.64).
PARTS = ("motor_lag", "friction", "ratio_error", "efficiency", "backlash", "hysteresis")


@dataclass
class DriveTrain:
    """Motor, gear and friction of one joint.

    The three friction coefficients act on the motor side: a joint-side torque is ``ratio`` times the Coulomb
    part and ``ratio**2`` times the viscous part, see `RobotModel.joint_viscous_friction`. What a ``friction``
    says is on the side of the link and comes on top of them.
    """

    ratio: float = 1.0  # turns of the motor per turn of the joint
    rotor_inertia: float = 0.0  # kg m^2, about the motor's axis
    stiffness: float = 0.0  # N m / rad, joint side, at rest
    stiffening: Stiffening | Cubic | Exponential | Limited | None = None  # under load
    damping: float = 0.0  # N m s / rad, joint side, parallel to the stiffness
    viscous_friction: float = 0.0  # N m s / rad, motor side
    coulomb_friction: float = 0.0  # N m, motor side
    coulomb_velocity: float = 0.01  # rad/s on the joint side, width of the tanh transition
    motor_lag: float = 0.0  # s, T of Reiner (2010) eq. (2.2)
    # Of the joint, on the side of the link, on top of the coefficients of the motor side
    friction: Sigmoid | Tanh | Stribeck | Polynomial | StickSlip | None = None
    ratio_error: FourierRatio | None = None  # the gear runs unevenly; left out: evenly
    efficiency: Efficiency | None = None  # losses in proportion to the load; left out: none
    backlash: Backlash | ViscoElastic | None = None  # a gap, or its visco-elastic substitute; left out: none
    hysteresis: Dahl | None = None  # the torque depends on past deflections; left out: no
    source: str = ""  # where the numbers come from, or ``assumed``

    @property
    def has_parts(self) -> bool:
        """Whether it is more than a linear or stiffening gear with friction."""
        return any(getattr(self, name) for name in PARTS)

    @property
    def spring(self) -> GearSpring:
        """The characteristic of the gear. Raises ValueError if it is impossible."""
        return self.stiffening.spring(self.stiffness) if self.stiffening else CubicSpring(self.stiffness, 0.0)

    def parts(self) -> JointTrain:
        """What the train is made of.

        Raises:
            ValueError: if a part refuses its numbers.
        """
        play = self.backlash if isinstance(self.backlash, Backlash) else Backlash()
        not_negative = {
            "motor_lag": self.motor_lag,
            "backlash: arc_minutes": play.arc_minutes,
            "backlash: lubricant": play.lubricant,
        }
        for label, value in not_negative.items():
            if value < 0.0:
                raise ValueError(f"{label} must not be negative, got {value}")
        frictions = [self.friction.part()] if self.friction else []
        if self.viscous_friction or self.coulomb_friction:
            viscous, coulomb = self.ratio**2 * self.viscous_friction, self.ratio * self.coulomb_friction
            frictions.append(TanhFriction(viscous, coulomb, self.coulomb_velocity))
        return JointTrain(
            spring=self.spring,
            damping=self.damping,
            inertia=self.ratio**2 * self.rotor_inertia,
            motor_lag=self.motor_lag,
            frictions=tuple(frictions),
            ratio=self.ratio_error.part(self.ratio) if self.ratio_error else None,
            efficiency=self.efficiency.part() if self.efficiency else None,
            gap=play.arc_minutes * ARC_MINUTE,
            lubricant=play.lubricant,
            soft=self.backlash.part() if isinstance(self.backlash, ViscoElastic) else None,
            hysteresis=self.hysteresis.part(self.stiffness) if self.hysteresis else None,
        )


@dataclass
class Tilting:
    """How the bearing of a joint yields across its axis: two springs about two axes square to it.

    Reiner (2010), section 2.4.1. For a joint about z the axes are x and y, about x they are y and z, about y
    they are z and x.
    """

    stiffness: list[float] = numbers((), (2,), 0.0, unit="N m / rad", is_open=True)  # of the two springs
    damping: list[float] = numbers((), (2,), 0.0, unit="N m s / rad")  # of the two springs
    stiffening_a: Cubic | Exponential | Limited | None = None  # of the first spring; left out: linear
    stiffening_b: Cubic | Exponential | Limited | None = None  # of the second one
    source: str = ""  # where the numbers come from, or ``assumed``

    def springs(self) -> tuple[GearSpring, GearSpring]:
        """The two characteristics. Raises ValueError if one is impossible."""
        first, second = self.stiffness
        a, b = self.stiffening_a or Cubic(), self.stiffening_b or Cubic()
        return a.spring(first), b.spring(second)


@dataclass
class DriveLimits:
    """Limits of one joint's motor and gear; what is left open is not known and does not limit a motion."""

    motor_torque: float | None = positive(None, "N m")  # of the motor's shaft, at any time
    # Likewise, root of the mean square over a motion: the current that heats the motor
    continuous_torque: float | None = positive(None, "N m")
    gear_torque: float | None = positive(None, "N m")  # joint side, that the gear carries
    gear_torque_rate: float | None = positive(None, "N m/s")  # joint side: jolts wear gears
    source: str = ""  # where the numbers come from, or ``assumed``


def drive_trains(trains: Sequence[DriveTrain]) -> DriveTrains | None:
    """The drive trains of joints, None if none has more than a linear or stiffening gear with friction."""
    return DriveTrains([train.parts() for train in trains]) if any(t.has_parts for t in trains) else None
