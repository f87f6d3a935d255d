"""A step in a smooth, noisy motion, told from the bends that the motion has anyway.

Over a window a polynomial is held against the same with a step in its middle. How much better the step
explains the samples counts in units of what it leaves, and of how slowly that changes: vibration hides steps
and is not taken for one.
"""

from dataclasses import dataclass

import numpy as np

HALF = 90  # samples before and after a step: with 0.05 mm of noise it takes so many to see 0.2 mm
# Of chi squared with three degrees of freedom. Noise alone passes 45 in one of 1e9 windows; but where a gear
# changes its flank there is a step of a third of 0.2 mm in every lap, which passed it once in eight hours.
THRESHOLD = 52.0
_DEGREE = 5  # of the bends: a circle of two seconds is followed over half of it
# So many samples next to it, over which an arm that starts off bends as a parabola, show a step as well
_NEAR, _NEAR_DEGREE = 24, 2
_APART = 0.02  # s, standard deviation of what clocks may be apart
_SAME, _SIGMAS = 0.5, 4.0  # share, and standard deviations, by which it may be another one there


@dataclass(frozen=True)
class Step:
    """A step of a vector."""

    onset: float  # s
    known: float  # s, of the sample with which it was known
    size: np.ndarray  # (3,), as the samples
    sigma: float  # of each of its entries


class StepDetector:
    """Looks for steps in samples of a vector that come one by one."""

    def __init__(self, least: float = 0.0, half: int = HALF) -> None:
        """Prepares the fits.

        Args:
            least: the smallest length of a step that counts.
            half: how many samples before a step and after it are taken.
        """
        self._least, self._half = least, half
        self._basis, self._length = _with_step(half, _DEGREE)
        self._near = min(half, _NEAR)
        self._near_basis, self._near_length = _with_step(self._near, _NEAR_DEGREE)
        self._times, self._values = np.zeros(2 * half), np.zeros((2 * half, 3))
        self._rates = np.zeros((2 * half, 3))
        self._count = 0
        self._best: tuple[float, Step] | None = None

    def add(self, time: float, value: np.ndarray, rate: np.ndarray | None = None) -> Step | None:
        """The next sample (3,) at a time in s; a step if one is known now.

        A step is known when its window explains it best, half a window after it at the latest. By its rate
        (3,) a sample changes for every second by which the clocks behind it are apart: what some offset of
        them explains is no step.
        """
        row = self._count % (2 * self._half)
        self._times[row], self._values[row] = time, value
        self._rates[row] = 0.0 if rate is None else rate
        self._count += 1
        if self._count < 2 * self._half:
            return None
        order = np.arange(row + 1, row + 1 + 2 * self._half) % (2 * self._half)
        # About one of them, so that squares of large numbers do not cancel.
        values = self._values[order] - self._values[row]
        parts, moves = self._basis.T @ values, self._basis.T @ self._rates[order]
        left, apart = values - self._basis @ parts, self._rates[order] - self._basis @ moves
        # By how much the clocks are apart is known beforehand, too.
        freedom = 3.0 * (2 * self._half - _DEGREE - 2)
        doubt = float(np.square(left).sum()) / freedom / _APART**2
        without = _less(np.vstack((left, parts[-1:])), np.vstack((apart, moves[-1:])), doubt)
        better = max(without - _less(left, apart, doubt), 0.0)
        offset = _offset(left, apart, doubt)
        left = left - offset * apart
        variance = max(float(np.square(left).sum()), np.finfo(float).tiny) / freedom
        size = (parts[-1] - offset * moves[-1]) / self._length
        if better > THRESHOLD * variance:
            variance *= _slowness(left)
        gain = better / variance
        is_one = gain > THRESHOLD and float(np.linalg.norm(size)) >= self._least
        if is_one:
            is_one = self._is_sharp(values - offset * self._rates[order], size)
        if is_one and (self._best is None or gain > self._best[0]):
            onset = float(self._times[order[self._half]])
            self._best = gain, Step(onset, time, size, float(np.sqrt(variance)) / self._length)
            return None
        if self._best is None:
            return None
        # It has passed the middle: what follows is of the same step, until the window has left it.
        found, self._best, self._count = self._best[1], None, 0
        return Step(found.onset, time, found.size, found.sigma)

    def _is_sharp(self, values: np.ndarray, size: np.ndarray) -> bool:
        """Whether the samples (n, 3) next to a step (3,) show it too; a bend is less of one there."""
        values = values[self._half - self._near : self._half + self._near]
        parts = self._near_basis.T @ values
        left = float(np.square(values).sum() - np.square(parts).sum())
        freedom = 3.0 * (len(values) - len(parts))
        sigma = np.sqrt(max(left, 0.0) / freedom) / self._near_length
        other = float(np.linalg.norm(parts[-1] / self._near_length - size))
        return other <= max(_SAME * float(np.linalg.norm(size)), _SIGMAS * sigma)


def _with_step(half: int, degree: int) -> tuple[np.ndarray, float]:
    """Columns of length 1 for polynomials and, the last, for a step in the middle; and what that has left."""
    place = (np.arange(2 * half) - half + 0.5) / half
    smooth, _ = np.linalg.qr(np.vander(place, degree + 1))
    step = np.where(place > 0.0, 1.0, 0.0)
    step -= smooth @ (smooth.T @ step)
    length = float(np.linalg.norm(step))
    return np.column_stack([smooth, step / length]), length


def _offset(left: np.ndarray, rates: np.ndarray, doubt: float) -> float:
    """By how many seconds of their rates rows (n, 3) are explained best; ``doubt`` is against any."""
    square = float(np.square(rates).sum()) + doubt
    return float((rates * left).sum()) / square if square > 0.0 else 0.0


def _less(left: np.ndarray, rates: np.ndarray, doubt: float) -> float:
    """What the best offset leaves of the squares of rows (n, 3), with what itself costs."""
    return float(np.square(left).sum()) - _offset(left, rates, doubt) * float((rates * left).sum())


def _slowness(left: np.ndarray) -> float:
    """How many rows (n, 3) are worth one that is independent: 1 for white noise, more for vibration."""
    alike = float((left[1:] * left[:-1]).sum()) / max(float(np.square(left).sum()), np.finfo(float).tiny)
    return (1.0 + max(alike, 0.0)) / max(1.0 - alike, 1e-3)
