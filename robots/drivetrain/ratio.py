"""Ratio error of a gear (teeth, eccentricity) as a Fourier series of its angle."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

_NEWTON_STEPS = 20
_EXACT_ENOUGH = 1e-9  # rad, what `position_error` may leave


@dataclass(frozen=True)
class FourierRatio:
    """The ratio i(phi_B) and the angle phi_A that it adds up to, Reiner (2010) eq. (2.6); any shape, rad.

    Parameters of several gears are arrays: one row of a series for each number of the base.
    """

    base: float | np.ndarray  # the mean ratio
    amplitudes: tuple[float, ...] | np.ndarray = ()
    frequencies: tuple[float, ...] | np.ndarray = ()  # per turn of the output, not always whole
    phases: tuple[float, ...] | np.ndarray = ()  # rad
    start: float = 0.0  # rad, of the input where the sines vanish at output zero
    invertible: ClassVar[bool] = True

    _terms: np.ndarray = field(init=False, repr=False, compare=False)
    _waves: list = field(init=False, repr=False, compare=False)  # amplitude over base, frequency, phase
    newton_steps: int = field(init=False, repr=False, compare=False)  # of `position_error`

    def __post_init__(self) -> None:
        if not np.shape(self.amplitudes) == np.shape(self.frequencies) == np.shape(self.phases):
            raise ValueError("FourierRatio: amplitudes, frequencies and phases must be equally many")
        terms = np.array([self.amplitudes, self.frequencies, self.phases], dtype=float)
        size = np.abs(terms[0]).sum(axis=-1)
        if np.any(terms[1] < 1.0):
            raise ValueError(
                f"FourierRatio: frequencies must be 1 or more, got {np.asarray(self.frequencies).tolist()}"
            )
        if not np.all(size < self.base):
            raise ValueError(
                f"FourierRatio: the amplitudes must add up to less than the ratio {self.base}, or the gear "
                f"would turn back, got {size}"
            )
        object.__setattr__(self, "_terms", terms)
        waves = [(a / self.base, f, p) for a, f, p in zip(*np.moveaxis(terms, -1, 1), strict=True)]
        object.__setattr__(self, "_waves", waves)
        object.__setattr__(self, "newton_steps", self._newton_steps(*np.abs(terms[:2])))

    def _newton_steps(self, amplitude: np.ndarray, frequency: np.ndarray) -> int:
        """How many steps from an even gear are exact enough.

        Each leaves the square of what was left, times half of the curvature over the least slope at most.
        """
        left = np.sum(amplitude / frequency, axis=-1) / self.base
        curved = 0.5 * np.sum(amplitude * frequency, axis=-1) / (self.base - amplitude.sum(axis=-1))
        for steps in range(1, _NEWTON_STEPS):
            left = curved * left**2
            if np.all(left < _EXACT_ENOUGH):
                return steps
        return _NEWTON_STEPS

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

    def position_error(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far in rad the output is ahead of an even gear, and the derivative of that by theta.

        The same as `output_angle`, in fewer steps for the tiny errors that gears have.

        Args:
            theta: input angle over the mean ratio in rad, with no start.
        """
        lead = theta
        for _ in range(self.newton_steps):
            excess, slope = lead - theta, np.ones_like(lead)
            for weight, frequency, phase in self._waves:
                angle = frequency * lead + phase
                excess, slope = excess + weight / frequency * np.sin(angle), slope + weight * np.cos(angle)
            lead = lead - excess / slope
        slope = np.ones_like(lead)
        for weight, frequency, phase in self._waves:
            slope = slope + weight * np.cos(frequency * lead + phase)
        return lead - theta, 1.0 / slope - 1.0

    def input_torque(self, torque_B: np.ndarray, phi_B: np.ndarray) -> np.ndarray:
        """-tau_B / i in N m, eq. (2.6c): what the input must hold, without losses."""
        return -np.asarray(torque_B) / self.ratio(phi_B)
