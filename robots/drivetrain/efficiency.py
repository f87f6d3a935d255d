"""Losses of a gear that depend on the way the power flows; rad/s and N m, arrays of any shape."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robots.drivetrain.friction import SigmoidFriction
from robots.drivetrain.monotone import monotone_inverse


@dataclass(frozen=True)
class DirectionalEfficiency:
    """Efficiency eta_1 where the input drives, eta_2 where it is driven, each falling with the speed.

    eta = at_rest - per_speed |w|, kept above ``_LEAST``.
    """

    forward: float  # eta_1 at rest, in (0, 1]
    backward: float  # eta_2 at rest, in (0, 1]
    forward_per_speed: float = 0.0  # s / rad
    backward_per_speed: float = 0.0  # s / rad

    invertible: ClassVar[bool] = False  # at rest it holds like sticking friction
    _LEAST: ClassVar[float] = 0.05

    def __post_init__(self) -> None:
        for label in ("forward", "backward"):
            if not 0.0 < getattr(self, label) <= 1.0:
                raise ValueError(
                    f"DirectionalEfficiency: {label} must be in (0, 1], got {getattr(self, label)}"
                )

    def both(self, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """eta_1 and eta_2 at a speed in rad/s."""
        forward = self.forward - self.forward_per_speed * np.abs(speed)
        backward = self.backward - self.backward_per_speed * np.abs(speed)
        return np.clip(forward, self._LEAST, 1.0), np.clip(backward, self._LEAST, 1.0)

    def factor(self, torque_A: np.ndarray, speed_A: np.ndarray) -> np.ndarray:
        """What remains of the input torque: eta_1 if power flows in, 1 / eta_2 else, Reiner (2010) (2.10).

        At rest the gear holds, which no factor can express; the first case is returned.
        """
        forward, backward = self.both(speed_A)
        power = np.asarray(torque_A) * speed_A
        drives = (power > 0.0) | ((power == 0.0) & (np.asarray(speed_A) >= 0.0))
        return np.where(drives, forward, 1.0 / backward)


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
