"""How far along a segment at what time: profiles s(t) from rest to rest, and how smooth they are.

Each says how many of its time derivatives are continuous over all times (``continuous_derivatives``), and its
largest acceleration as a multiple of length / duration^2 (``peak``).
"""

import math
from typing import Self

import numpy as np


class SineSquaredProfile:
    """s(t) from 0 to ``length``, rest to rest, with two sin^2 humps of acceleration, Probst (2024) eq. (5.2).

    Each hump lasts T = sqrt(2 length / k_a); the speed peaks between them at sqrt(k_a length / 2). The fourth
    derivative jumps where a hump begins and ends.
    """

    continuous_derivatives = 3
    peak = 8.0

    def __init__(self, acceleration: float, length: float = 1.0) -> None:
        self.length = length
        self.hump = math.sqrt(2.0 * length / acceleration)  # s
        self.duration = 2.0 * self.hump  # s
        self._acceleration = acceleration
        self._frequency = math.pi / self.hump  # rad/s

    @classmethod
    def lasting(cls, duration: float, length: float = 1.0) -> Self:
        """The profile that takes so long, in s."""
        return cls(cls.peak * length / duration**2, length)

    def at(self, t: float) -> tuple[float, float, float]:
        """s, ds/dt and d2s/dt2, t seconds after the start; at rest before the start and after the end."""
        if t <= 0.0:
            return 0.0, 0.0, 0.0
        if t >= self.duration:
            return self.length, 0.0, 0.0
        if t <= self.hump:
            u = self._frequency * t
            return self._first_hump(t, math.sin(u), math.cos(u))
        t = self.duration - t
        u = self._frequency * t
        s, rate, acceleration = self._first_hump(t, math.sin(u), math.cos(u))
        return self.length - s, rate, -acceleration

    def at_times(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same for an array of times of any shape."""
        t = np.clip(t, 0.0, self.duration)
        second = t > self.hump
        t = np.where(second, self.duration - t, t)
        u = self._frequency * t
        s, rate, acceleration = self._first_hump(t, np.sin(u), np.cos(u))
        return np.where(second, self.length - s, s), rate, np.where(second, -acceleration, acceleration)

    def _first_hump(self, t, sine, cosine):
        """Eq. (5.2) and its two integrals up to t <= T; the second hump is its mirror image in time."""
        half, q = 0.5 * self._acceleration, sine / self._frequency
        return 0.5 * half * (t * t - q * q), half * (t - q * cosine), 2.0 * half * sine * sine


class PolynomialProfile:
    """s(t) from 0 to ``length``, rest to rest, as a polynomial of degree 11: five derivatives are continuous.

    ds/dx = 2772 x^5 (1 - x)^5 with x = t / duration, the only one of this degree whose first five derivatives
    are zero at both ends. An elastic inverse needs four.
    """

    continuous_derivatives = 5
    peak = 13860.0 * (2.0 / 9.0) ** 4 / 3.0

    def __init__(self, acceleration: float, length: float = 1.0) -> None:
        self.length = length
        self.duration = math.sqrt(self.peak * length / acceleration)  # s

    @classmethod
    def lasting(cls, duration: float, length: float = 1.0) -> Self:
        """The profile that takes so long, in s."""
        return cls(cls.peak * length / duration**2, length)

    def at(self, t: float) -> tuple[float, float, float]:
        """s, ds/dt and d2s/dt2, t seconds after the start; at rest before the start and after the end."""
        if t <= 0.0:
            return 0.0, 0.0, 0.0
        if t >= self.duration:
            return self.length, 0.0, 0.0
        is_second = t > 0.5 * self.duration
        s, rate, acceleration = self._first_half(self.duration - t if is_second else t)
        return (self.length - s, rate, -acceleration) if is_second else (s, rate, acceleration)

    def at_times(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same for an array of times of any shape."""
        t = np.clip(t, 0.0, self.duration)
        second = t > 0.5 * self.duration
        s, rate, acceleration = self._first_half(np.where(second, self.duration - t, t))
        return np.where(second, self.length - s, s), rate, np.where(second, -acceleration, acceleration)

    def _first_half(self, t):
        """From the start, where powers of x are small; the second half is its mirror image in time."""
        x = t / self.duration
        u = x * (1.0 - x)
        u_2 = u * u
        u_4, x_3 = u_2 * u_2, x * x * x
        s = x_3 * x_3 * (462.0 - x * (1980.0 - x * (3465.0 - x * (3080.0 - x * (1386.0 - x * 252.0)))))
        rate = 2772.0 * u_4 * u / self.duration
        acceleration = 13860.0 * u_4 * (1.0 - 2.0 * x) / self.duration**2
        return self.length * s, self.length * rate, self.length * acceleration


Profile = SineSquaredProfile | PolynomialProfile

TIMINGS: dict[str, type[Profile]] = {"sine_squared": SineSquaredProfile, "polynomial": PolynomialProfile}
