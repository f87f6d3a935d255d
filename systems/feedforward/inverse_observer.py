"""Control inside a feedforward: an inverse disturbance observer around an approximate inverse.

A model of the plant runs beside the inverse. What the model makes of the inverse's commands is compared with
what was wanted, and the filtered error is added to what the inverse is asked for: Reiner (2010), section
5.2.1. Nothing of it is measured, so any inverse may be in the middle and any output may be compared.

As far as the filter Q passes, the loop inverts the model exactly. A zero in the right half-plane cannot be
inverted so, which bounds the bandwidth of Q.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from pydrake.systems.primitives import LinearSystem

from robots.dynamics.transmission_zeros import Zeros

_SHARE = 0.6  # of the slowest zero in the right half-plane; the error is halved there


@dataclass(frozen=True)
class InverseObserver:
    """The filter Q, a Bessel low-pass, and what it makes of an error, Q / (1 - Q).

    Attributes:
        bandwidth: in Hz, where Q passes 1 / sqrt(2).
        order: of Q; at least as many as the inverse differentiates.
    """

    bandwidth: float
    order: int = 4

    def __post_init__(self) -> None:
        """Checks the numbers.

        Raises:
            ValueError: if one of them is impossible.
        """
        if not 0.0 < self.bandwidth < np.inf:
            raise ValueError(f"inverse observer: bandwidth must be positive, got {self.bandwidth} Hz")
        if not 1 <= self.order <= 8:
            raise ValueError(f"inverse observer: order must be between 1 and 8, got {self.order}")

    @staticmethod
    def highest_bandwidth(zeros: Zeros) -> float:
        """The slowest zero in the right half-plane in Hz, infinite if there is none."""
        slowest = zeros.slowest_rhp
        return np.inf if slowest is None else slowest / (2.0 * np.pi)

    @classmethod
    def beside(cls, zeros: Zeros, bandwidth: float | None = None, order: int = 4) -> "InverseObserver":
        """An observer for a model with these zeros.

        Args:
            zeros: of the model, from what the inverse commands to what is compared.
            bandwidth: in Hz; None for 0.6 times the slowest zero in the right half-plane.
            order: of Q.

        Raises:
            ValueError: if the bandwidth is not below that zero, or there is none to choose it by.
        """
        highest = cls.highest_bandwidth(zeros)
        if bandwidth is None:
            if not np.isfinite(highest):
                raise ValueError(
                    "inverse observer: the model has no zero in the right half-plane by which to choose the "
                    "bandwidth; give one"
                )
            bandwidth = _SHARE * highest
        if bandwidth >= highest:
            raise ValueError(
                f"inverse observer: bandwidth must be below {highest:.1f} Hz, the slowest zero of the model "
                f"in the right half-plane, got {bandwidth:g} Hz"
            )
        return cls(bandwidth, order)

    def gain(self) -> tuple[Polynomial, Polynomial]:
        """Q / (1 - Q), numerator and denominator in s; an integrator, so that no error stays."""
        below = bessel_denominator(self.order, self.bandwidth).coef
        below[0] = 0.0  # one less one
        return Polynomial([1.0]), Polynomial(below)

    def system(self, channels: int = 1) -> LinearSystem:
        """The same for so many outputs: from wanted less reached outputs of the model to a correction."""
        from scipy.signal import tf2ss  # here: half a second that few need

        numerator, denominator = self.gain()
        A, B, C, D = tf2ss(numerator.coef[::-1], denominator.coef[::-1])
        each = np.eye(channels)
        return LinearSystem(np.kron(each, A), np.kron(each, B), np.kron(each, C), np.kron(each, D))


def bessel_denominator(order: int, hertz: float) -> Polynomial:
    """Of a Bessel low-pass with the numerator 1, in s; it passes 1 / sqrt(2) at so many hertz."""
    from scipy.signal import besselap  # here: half a second that few need

    poles = besselap(order, norm="mag")[1] * 2.0 * np.pi * hertz
    coefficients = np.poly(poles).real[::-1]
    return Polynomial(coefficients / coefficients[0])
