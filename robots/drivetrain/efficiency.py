"""Gear efficiency that depends on the direction of power flow; rad/s and N m, arrays of any shape."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robots.drivetrain.friction import SigmoidFriction
from robots.drivetrain.monotone import monotone_inverse


@dataclass(frozen=True)
class DirectionalEfficiency:
    """Efficiency eta_1 where the input drives, eta_2 where it is driven, each falling with the speed.

    eta = at_rest - per_speed |w|, kept above ``LEAST``.
    """

    forward: float  # eta_1 at rest, in (0, 1]
    backward: float  # eta_2 at rest, in (0, 1]
    forward_per_speed: float = 0.0  # s / rad
    backward_per_speed: float = 0.0  # s / rad
    rest_width: float = 0.01  # rad/s, over which `loss` changes its sign

    invertible: ClassVar[bool] = False  # at rest it holds like sticking friction
    LEAST: ClassVar[float] = 0.05

    def __post_init__(self) -> None:
        for label in ("forward", "backward"):
            value = getattr(self, label)
            if not np.all(np.greater(value, 0.0) & np.less_equal(value, 1.0)):
                raise ValueError(
                    f"DirectionalEfficiency: {label} must be in (0, 1], got {getattr(self, label)}"
                )
        for label in ("forward_per_speed", "backward_per_speed"):
            if np.any(np.less(getattr(self, label), 0.0)):
                raise ValueError(
                    f"DirectionalEfficiency: {label} must not be negative, got {getattr(self, label)}"
                )
        if not np.all(np.greater(self.rest_width, 0.0)):
            raise ValueError(f"DirectionalEfficiency: rest_width must be positive, got {self.rest_width}")

    def both(self, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """eta_1 and eta_2 at a speed in rad/s."""
        forward = self.forward - self.forward_per_speed * np.abs(speed)
        backward = self.backward - self.backward_per_speed * np.abs(speed)
        return np.clip(forward, self.LEAST, 1.0), np.clip(backward, self.LEAST, 1.0)

    def factor(self, torque_A: np.ndarray, speed_A: np.ndarray) -> np.ndarray:
        """What remains of the input torque: eta_1 if power flows in, 1 / eta_2 else, Reiner (2010) (2.10).

        At rest the gear holds, which no factor can express; the first case is returned.
        """
        forward, backward = self.both(speed_A)
        power = np.asarray(torque_A) * speed_A
        drives = (power > 0.0) | ((power == 0.0) & (np.asarray(speed_A) >= 0.0))
        return np.where(drives, forward, 1.0 / backward)

    def loss(self, load: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """What the input has to give beyond the load in N m, smooth through rest; it never drives.

        The load is what the output gives, so the input gives load / eta_1 where it drives and eta_2 load
        where it is driven. The loss acts like friction in proportion to the load and vanishes at rest; the
        smooth change of (2.11) leaves a loss of the wrong sign there, which would create energy.

        Args:
            load: torque in N m that the gear gives to its output, with the ratio one.
            speed: rad/s.
        """
        forward, backward = self.both(speed)
        drives = np.asarray(load) * speed > 0.0
        share = np.where(drives, 1.0 / forward - 1.0, 1.0 - backward)
        return share * np.abs(load) * np.tanh(speed / self.rest_width)


@dataclass(frozen=True)
class SmoothEfficiency:
    """The same with a smooth change of direction and with friction, Reiner (2010) eq. (2.11); invertible."""

    efficiency: DirectionalEfficiency
    ratio: float
    friction: SigmoidFriction  # at the input
    steepness: float  # 1 / W, of the change from driving to being driven

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for label in ("ratio", "steepness"):
            if not getattr(self, label) > 0.0:
                raise ValueError(f"SmoothEfficiency: {label} must be positive, got {getattr(self, label)}")

    def loss(self, torque_A: np.ndarray, speed_A: np.ndarray) -> np.ndarray:
        """tau_loss in N m, eqs. (2.11b), (2.11c), with one friction for both directions."""
        return self._load_loss(torque_A, speed_A)[0] + self.friction.torque(np.asarray(speed_A))

    def _load_loss(self, torque_A: np.ndarray, speed_A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the load loses, without friction, and its derivative by the torque."""
        forward, backward = self.efficiency.both(speed_A)
        power = self.steepness * np.asarray(torque_A) * speed_A
        share = np.arctan(power) / np.pi + 0.5
        load = share * (1.0 - forward) + (1.0 - share) * (1.0 - 1.0 / backward)
        # d(share) / d(torque) times the torque
        change = power / (np.pi * (1.0 + np.square(power)))
        return load * torque_A, load + change * (1.0 / backward - forward)

    def output_torque(self, torque_A: np.ndarray, speed_A: np.ndarray) -> np.ndarray:
        """What the gear gives to the output: i (tau_A - tau_loss) in N m, -tau_B of eq. (2.11a)."""
        return self.ratio * (np.asarray(torque_A) - self.loss(torque_A, speed_A))

    def input_torque(self, output: np.ndarray, speed_A: np.ndarray) -> np.ndarray:
        """The inverse of `output_torque` at a speed."""
        wanted = np.asarray(output, dtype=float) / self.ratio + self.friction.torque(np.asarray(speed_A))

        def without_friction(torque: np.ndarray) -> np.ndarray:
            return torque - self._load_loss(torque, speed_A)[0]

        def slope(torque: np.ndarray) -> np.ndarray:
            return 1.0 - self._load_loss(torque, speed_A)[1]

        return monotone_inverse(without_friction, slope, wanted, np.maximum(np.abs(wanted), 1e-9))
