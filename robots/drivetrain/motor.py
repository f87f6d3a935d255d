"""First-order lag between current and torque of a motor."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np


@dataclass(frozen=True)
class MotorLag:
    """tau + T d(tau)/dt = k_T I, Reiner (2010) eq. (2.2); arrays of any shape."""

    time_constant: float  # s
    torque_constant: float  # N m / A

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not self.time_constant > 0.0 or self.torque_constant == 0.0:
            raise ValueError(
                "MotorLag: time_constant must be positive and torque_constant not zero, got "
                f"{self.time_constant} s and {self.torque_constant} N m / A"
            )

    def torque_rate(self, torque: np.ndarray, current: np.ndarray) -> np.ndarray:
        """d(tau)/dt in N m / s."""
        return (self.torque_constant * np.asarray(current) - torque) / self.time_constant

    def current(self, torque: np.ndarray, torque_rate: np.ndarray) -> np.ndarray:
        """The current in A that makes a torque change as wanted: the inverse."""
        return (np.asarray(torque) + self.time_constant * np.asarray(torque_rate)) / self.torque_constant
