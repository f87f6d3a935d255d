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
        place = (np.arange(2 * half) - half + 0.5) / half
        smooth, _ = np.linalg.qr(np.vander(place, _DEGREE + 1))
        step = np.where(place > 0.0, 1.0, 0.0)
        step -= smooth @ (smooth.T @ step)
        self._length = float(np.linalg.norm(step))
        self._basis = np.column_stack([smooth, step / self._length])  # orthonormal, the step last
        self._times, self._values = np.zeros(2 * half), np.zeros((2 * half, 3))
        self._count = 0
        self._best: tuple[float, Step] | None = None

    def add(self, time: float, value: np.ndarray) -> Step | None:
        """The next sample (3,) at a time in s; a step if one is known now.

        A step is known when its window explains it best, half a window after it at the latest.
        """
        row = self._count % (2 * self._half)
        self._times[row], self._values[row] = time, value
        self._count += 1
        if self._count < 2 * self._half:
            return None
        order = np.arange(row + 1, row + 1 + 2 * self._half) % (2 * self._half)
        # About one of them, so that squares of large numbers do not cancel.
        values = self._values[order] - self._values[row]
        parts = self._basis.T @ values
        left = float(np.square(values).sum() - np.square(parts).sum())
        variance = max(left, np.finfo(float).tiny) / (3.0 * (2 * self._half - _DEGREE - 2))
        size = parts[-1] / self._length
        if float(np.square(parts[-1]).sum()) > THRESHOLD * variance:
            variance *= _slowness(values - self._basis @ parts)
        gain = float(np.square(parts[-1]).sum()) / variance
        is_one = gain > THRESHOLD and float(np.linalg.norm(size)) >= self._least
        if is_one and (self._best is None or gain > self._best[0]):
            onset = float(self._times[order[self._half]])
            self._best = gain, Step(onset, time, size, float(np.sqrt(variance)) / self._length)
            return None
        if self._best is None:
            return None
        # It has passed the middle: what follows is of the same step, until the window has left it.
        found, self._best, self._count = self._best[1], None, 0
        return Step(found.onset, time, found.size, found.sigma)


def _slowness(left: np.ndarray) -> float:
    """How many rows (n, 3) are worth one that is independent: 1 for white noise, more for vibration."""
    alike = float((left[1:] * left[:-1]).sum()) / max(float(np.square(left).sum()), np.finfo(float).tiny)
    return (1.0 + max(alike, 0.0)) / max(1.0 - alike, 1e-3)
