"""Hysteresis of gears as a sum of play operators, its exact inverse, and a smooth approximation.

Prandtl-Ishlinskii operators, Reiner (2010) section 2.3.5. A signal is a row of samples. The output lags the
input: a deflection that follows a torque so loses energy in every cycle. A torque that followed a deflection
so, as in eq. (2.19), would gain it; there the inverse operator belongs.
"""

from dataclasses import dataclass
from math import comb
from typing import Any, ClassVar

import numpy as np
from scipy.special import expit

_NEWTON_STEPS, _SOLVED = 60, 1e-12
_ROUNDING = 1e-12  # of the largest threshold


def play(x: np.ndarray | float, before: np.ndarray, threshold: np.ndarray) -> np.ndarray:
    """One step of the play operator, eq. (2.13): the output, in the unit of x, moves when x pushes it."""
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

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not self.sharpness > 0.0:
            raise ValueError(f"SmoothPrandtlIshlinskii: sharpness must be positive, got {self.sharpness}")
        pade_delay(self.delay, self.order)

    def play(self, x: np.ndarray, before: np.ndarray, threshold: np.ndarray) -> np.ndarray:
        """One step of the smooth play operator: `play` with rounded corners, in the unit of x."""
        psi = self.sharpness
        least = -np.logaddexp(-psi * (x + threshold), -psi * before) / psi
        return np.logaddexp(psi * (x - threshold), psi * least) / psi

    def play_slope(self, x: np.ndarray, before: np.ndarray, threshold: np.ndarray) -> np.ndarray:
        """The derivative of the smooth play operator by its input, from 0 to 1."""
        psi = self.sharpness
        least = -np.logaddexp(-psi * (x + threshold), -psi * before) / psi
        pulled, pushed = expit(psi * (before - x - threshold)), expit(psi * (x - threshold - least))
        return pushed + (1.0 - pushed) * pulled

    def response(self, x: np.ndarray, step: float) -> np.ndarray:
        """The output along samples x, shape (n,), a time of ``step`` s apart and shorter than the delay."""
        weights, thresholds = np.array(self.exact.weights), np.array(self.exact.thresholds)
        A, B, C = self._delay(step)
        states, out = np.zeros((len(A), len(weights))), np.empty(len(x))
        for k, sample in enumerate(x):
            y = self.play(sample, (C @ states)[0], thresholds)
            states = A @ states + B * y
            out[k] = weights @ y
        return out

    def inverse_response(self, wanted: np.ndarray, step: float) -> np.ndarray:
        """The input that leads to an output: sample by sample the equation of `response`, solved for x.

        The smooth form of the operator's exact inverse is something else: its errors are those of the smooth
        play of other thresholds and add up with the errors of this one.

        Args:
            wanted: samples of the output, shape (n,).
            step: time between them in s, shorter than the delay.

        Raises:
            ValueError: if the operator is not increasing: all weights must be positive or zero.
        """
        weights, thresholds = np.array(self.exact.weights), np.array(self.exact.thresholds)
        if (weights < 0.0).any():
            raise ValueError(f"SmoothPrandtlIshlinskii: weights must not be negative, got {weights.tolist()}")
        A, B, C = self._delay(step)
        states, out, x = np.zeros((len(A), len(weights))), np.empty(len(wanted)), 0.0
        for k, target in enumerate(wanted):
            x = self._solved(x, float(target), (C @ states)[0], weights, thresholds)
            states = A @ states + B * self.play(np.array(x), (C @ states)[0], thresholds)
            out[k] = x
        return out

    def _solved(
        self, x: float, target: float, before: np.ndarray, weights: np.ndarray, thresholds: np.ndarray
    ) -> float:
        """The input of one sample by Newton's method within a bracket."""
        lower, upper = -np.inf, np.inf
        for _ in range(_NEWTON_STEPS):
            excess = float(weights @ self.play(np.array(x), before, thresholds)) - target
            lower, upper = (x, upper) if excess < 0.0 else (lower, x)
            step = excess / float(weights @ self.play_slope(np.array(x), before, thresholds))
            if abs(step) < _SOLVED:
                break
            x -= step
            if not lower < x < upper:
                x = 0.5 * (lower + upper)
        return x

    def _delay(self, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The Pade delay for steps of a time in s."""
        if not 0.0 < step < self.delay:
            raise ValueError(f"SmoothPrandtlIshlinskii: step must be below the delay, got {step} s")
        from scipy.signal import cont2discrete, tf2ss  # here: half a second that few need

        delay: Any = cont2discrete(tf2ss(*pade_delay(self.delay, self.order)), step, method="zoh")
        A, B, C = (np.asarray(matrix) for matrix in delay[:3])
        return A, B, C
