"""How far along a path at what time: s(t) from rest to rest as a spline of degree 7."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline

DEGREE = 7
AT_REST = 6  # coefficients at each end: value and five derivatives there are those of rest
_GRADING = 0.75  # 0 for equal intervals; towards 1 they are shorter at the ends, where a motion starts
_PER_INTERVAL = 5  # points at which limits are kept


@dataclass(frozen=True)
class TimeSpline:
    """s(t); five derivatives are continuous over all times, also where the motion begins and ends.

    Attributes:
        coefficients: of the spline over t / duration, shape (n,); the first and last six are 0 and 1.
        duration: s.
    """

    coefficients: np.ndarray
    duration: float

    def rates(self, t: np.ndarray) -> np.ndarray:
        """s and its first four derivatives by time at t in s, shape (n,); shape (5, n)."""
        x = np.clip(np.asarray(t, dtype=float) / self.duration, 0.0, 1.0)
        spline = BSpline(knots(len(self.coefficients)), self.coefficients, DEGREE)
        return np.array([(spline.derivative(d) if d else spline)(x) / self.duration**d for d in range(5)])

    @property
    def times(self) -> np.ndarray:
        """Times in s that resolve the motion, shape (m,)."""
        return self.duration * points(len(self.coefficients), 20)


@lru_cache
def knots(count: int) -> np.ndarray:
    """Of a spline over 0 to 1 with ``count`` coefficients, shape (count + DEGREE + 1,)."""
    u = np.linspace(0.0, 1.0, count - DEGREE + 1)
    breaks = u - _GRADING * np.sin(2.0 * np.pi * u) / (2.0 * np.pi)
    return np.concatenate([np.zeros(DEGREE), breaks, np.ones(DEGREE)])


@lru_cache
def points(count: int, per_interval: int = _PER_INTERVAL) -> np.ndarray:
    """Points from 0 to 1 that resolve such a spline, rising, shape (m,)."""
    breaks = knots(count)[DEGREE:-DEGREE]
    inside = np.arange(per_interval) / per_interval
    return np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * inside).ravel(), 1.0)


@lru_cache
def bases(count: int) -> list[np.ndarray]:
    """The splines and their four derivatives at `points`, (m, count) each."""
    x = points(count)
    spline = BSpline(knots(count), np.eye(count), DEGREE)
    return [(spline.derivative(d) if d else spline)(x) for d in range(5)]


def weights(count: int) -> np.ndarray:
    """Of the trapezoidal rule over `points`, shape (m,)."""
    x = points(count)
    half = 0.5 * np.diff(x)
    return np.append(half, 0.0) + np.append(0.0, half)


def fitted(x: np.ndarray, s: np.ndarray, duration: float, count: int) -> TimeSpline:
    """The spline next to s at t / duration = x, shape (n,) each.

    Args:
        x: from 0 to 1.
        s: from 0 to 1.
        duration: s.
        count: of its coefficients.
    """
    basis = BSpline(knots(count), np.eye(count), DEGREE)(x)
    coefficients = at_rest(count)
    free = slice(AT_REST, count - AT_REST)
    coefficients[free] = np.linalg.lstsq(basis[:, free], s - basis @ coefficients, rcond=None)[0]
    return TimeSpline(np.maximum.accumulate(np.clip(coefficients, 0.0, 1.0)), duration)


def at_rest(count: int) -> np.ndarray:
    """Coefficients, shape (count,), that hold the ends at rest; those between are zero."""
    coefficients = np.zeros(count)
    coefficients[count - AT_REST :] = 1.0
    return coefficients
