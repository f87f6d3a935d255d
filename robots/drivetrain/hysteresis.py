"""Hysteresis of gears as a sum of play operators, its exact inverse, and a smooth approximation.

Prandtl-Ishlinskii operators, Reiner (2010) section 2.3.5. A signal is a row of samples. The output lags the
input: a deflection that follows a torque so loses energy in every cycle. A torque that followed a deflection
so, as in eq. (2.19), would gain it; there the inverse operator belongs.
"""

from dataclasses import dataclass
from math import comb
from typing import Any, ClassVar

import numpy as np
from scipy.signal import cont2discrete, tf2ss

_ROUNDING = 1e-12  # of the largest threshold


def play(x: np.ndarray | float, before: np.ndarray, threshold: np.ndarray) -> np.ndarray:
    """One step of the play operator, eq. (2.13): the output moves only when the input pushes it."""
    return np.maximum(x - threshold, np.minimum(x + threshold, before))


@dataclass(frozen=True)
class PrandtlIshlinskii:
    """sum_i w_i P_{r_i}[x], eq. (2.14), with thresholds r_0 = 0 < r_1 < ... as its inverse needs them.

    With r_0 = 0.1, as table 2.1 has it, an error of 0.1 would remain. Weights after the first may be negative
    as long as every partial sum stays positive, which is what the inverse of an operator looks like.
    """

    weights: tuple[float, ...]
    thresholds: tuple[float, ...]

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        weights, thresholds = np.array(self.weights), np.array(self.thresholds)
        if len(weights) != len(thresholds) or not len(weights):
            raise ValueError("PrandtlIshlinskii: weights and thresholds must be equally many, one or more")
        if thresholds[0] != 0.0 or (np.diff(thresholds) <= 0.0).any():
            raise ValueError(
                f"PrandtlIshlinskii: thresholds must begin with 0 and increase, got {list(self.thresholds)}"
            )
        if (np.cumsum(weights) <= 0.0).any():
            raise ValueError(
                f"PrandtlIshlinskii: partial sums of weights must be positive, got {list(weights)}"
            )

    def response(self, x: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """The output along a signal.

        Args:
            x: samples, shape (n,).
            start: outputs of the play operators before the first sample, shape (number,); None for zeros.

        Returns:
            Samples, shape (n,).
        """
        weights, thresholds = np.array(self.weights), np.array(self.thresholds)
        y = np.zeros(len(weights)) if start is None else np.asarray(start, dtype=float)
        out = np.empty(len(x))
        for k, sample in enumerate(x):
            y = play(sample, y, thresholds)
            out[k] = weights @ y
        return out

    def inverse(self, start: np.ndarray | None = None) -> tuple["PrandtlIshlinskii", np.ndarray]:
        """The operator that undoes this one, eq. (2.16), corrected, and where its play operators start.

        In (2.16c) y'_i = sum_{j<=i} w_j y_i + sum_{j>i} w_j y_j; the printed y_j in the first sum is wrong.

        Raises:
            ValueError: if no input can have led to the start; no operator would undo this one from there.
        """
        w, r = np.array(self.weights), np.array(self.thresholds)
        y = np.zeros(len(w)) if start is None else np.asarray(start, dtype=float)
        if (np.abs(np.diff(y)) > np.diff(r) + _ROUNDING * r[-1]).any():
            raise ValueError(
                f"PrandtlIshlinskii: no input leads to the start {y.tolist()}: neighbours may differ by "
                f"{np.diff(r).tolist()} at most"
            )
        sums = np.cumsum(w)
        weights = np.concatenate([[1.0 / w[0]], -w[1:] / (sums[1:] * sums[:-1])])
        thresholds = np.array([np.sum(w[: i + 1] * (r[i] - r[: i + 1])) for i in range(len(w))])
        starts = np.array([sums[i] * y[i] + np.sum(w[i + 1 :] * y[i + 1 :]) for i in range(len(w))])
        return PrandtlIshlinskii(tuple(weights.tolist()), tuple(thresholds.tolist())), starts


def pade_delay(delay: float, order: int) -> tuple[np.ndarray, np.ndarray]:
    """A dead time in s as a transfer function with one zero less than poles, eq. (2.18).

    Returns:
        Numerator and denominator, the highest power first. The coefficients of the source are right, its
        text exchanges the degrees.

    Raises:
        ValueError: if the delay is not positive or the order is below one.
    """
    if not delay > 0.0 or order < 1:
        raise ValueError(
            f"pade_delay: needs a positive delay and an order of 1 or more, got {delay} s, {order}"
        )

    def falling(i: int) -> float:
        return float(np.prod([2 * order - 1 - j for j in range(i)], dtype=float))

    a = [comb(order, i) / falling(i) * delay**i for i in range(order + 1)]
    b = [(-1) ** i * comb(order - 1, i) / falling(i) * delay**i for i in range(order)]
    return np.array(b[::-1]), np.array(a[::-1])


@dataclass(frozen=True)
class SmoothPrandtlIshlinskii:
    """The same operator with continuous derivatives: log-sum-exp for max and min, a Pade delay for the past.

    Eqs. (2.17), (2.18); ``sharpness`` is psi, which table 2.1 calls s.
    """

    exact: PrandtlIshlinskii
    sharpness: float  # 1 / rad
    delay: float  # s
    order: int  # of the Pade approximation

    # As nearly as it is the operator: its inverse is the smooth form of the operator's inverse.
    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not self.sharpness > 0.0:
            raise ValueError(f"SmoothPrandtlIshlinskii: sharpness must be positive, got {self.sharpness}")
        pade_delay(self.delay, self.order)

    def play(self, x: np.ndarray, before: np.ndarray, threshold: np.ndarray) -> np.ndarray:
        """The smooth play operator."""
        psi = self.sharpness
        least = -np.logaddexp(-psi * (x + threshold), -psi * before) / psi
        return np.logaddexp(psi * (x - threshold), psi * least) / psi

    def response(self, x: np.ndarray, step: float) -> np.ndarray:
        """The output along samples x, shape (n,), a time of ``step`` s apart and shorter than the delay."""
        if not 0.0 < step < self.delay:
            raise ValueError(f"SmoothPrandtlIshlinskii: step must be below the delay, got {step} s")
        delay: Any = cont2discrete(tf2ss(*pade_delay(self.delay, self.order)), step, method="zoh")
        A, B, C = (np.asarray(matrix) for matrix in delay[:3])
        weights, thresholds = np.array(self.exact.weights), np.array(self.exact.thresholds)
        states, out = np.zeros((len(A), len(weights))), np.empty(len(x))
        for k, sample in enumerate(x):
            y = self.play(sample, (C @ states)[0], thresholds)
            states = A @ states + B * y
            out[k] = weights @ y
        return out
