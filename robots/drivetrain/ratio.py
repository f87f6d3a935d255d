"""A gear whose ratio is not quite constant: teeth and eccentric wheels as a Fourier series of its angle."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

_NEWTON_STEPS = 20


@dataclass(frozen=True)
class FourierRatio:
    """The ratio i(phi_B) and the angle phi_A that it adds up to, Reiner (2010) eq. (2.6); any shape, rad."""

    base: float  # the mean ratio
    amplitudes: tuple[float, ...] = ()
    frequencies: tuple[int, ...] = ()  # per turn of the output
    phases: tuple[float, ...] = ()  # rad
    start: float = 0.0  # rad, of the input where the sines vanish at output zero
    invertible: ClassVar[bool] = True

    _terms: np.ndarray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not len(self.amplitudes) == len(self.frequencies) == len(self.phases):
            raise ValueError("FourierRatio: amplitudes, frequencies and phases must be equally many")
        if any(frequency < 1 for frequency in self.frequencies):
            raise ValueError(f"FourierRatio: frequencies must be 1 or more, got {list(self.frequencies)}")
        if not np.abs(self.amplitudes).sum() < self.base:
            raise ValueError(
                f"FourierRatio: the amplitudes must add up to less than the ratio {self.base}, or the gear "
                f"would turn back, got {np.abs(self.amplitudes).sum()}"
            )
        terms = np.array([self.amplitudes, self.frequencies, self.phases], dtype=float)
        object.__setattr__(self, "_terms", terms)

    def ratio(self, phi_B: np.ndarray) -> np.ndarray:
        """d(phi_A) / d(phi_B), eq. (2.6a)."""
        amplitude, frequency, phase = self._terms
        angle = np.asarray(phi_B)[..., None] * frequency + phase
        return self.base + np.sum(amplitude * np.cos(angle), axis=-1)

    def input_angle(self, phi_B: np.ndarray) -> np.ndarray:
        """phi_A in rad, eq. (2.6b)."""
        amplitude, frequency, phase = self._terms
        angle = np.asarray(phi_B)[..., None] * frequency + phase
        return self.base * phi_B + np.sum(amplitude / frequency * np.sin(angle), axis=-1) + self.start

    def output_angle(self, phi_A: np.ndarray) -> np.ndarray:
        """phi_B in rad, the inverse of `input_angle` by Newton's method from the mean ratio."""
        phi_A = np.asarray(phi_A, dtype=float)
        phi_B = (phi_A - self.start) / self.base
        for _ in range(_NEWTON_STEPS):
            phi_B = phi_B - (self.input_angle(phi_B) - phi_A) / self.ratio(phi_B)
        return phi_B

    def input_torque(self, torque_B: np.ndarray, phi_B: np.ndarray) -> np.ndarray:
        """-tau_B / i in N m, eq. (2.6c): what the input must hold, without losses."""
        return -np.asarray(torque_B) / self.ratio(phi_B)
