"""A straight way of the end of an arm with two joints in a plane, with five continuous derivatives."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

_RISE = Polynomial([0, 0, 0, 0, 0, 0, 462, -1980, 3465, -3080, 1386, -252])


@dataclass(frozen=True)
class EndPath:
    """From rest to rest; both links of the arm are 1 m long, the elbow is above the line to the end."""

    begin: tuple[float, float]  # m
    end: tuple[float, float]  # m
    start: float  # s, when it begins
    duration: float  # s

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions in m at times in s and their two derivatives, (n, 2) each."""
        s = np.clip((times - self.start) / self.duration, 0.0, 1.0)
        lead = np.subtract(self.end, self.begin)
        rise = [np.outer(_RISE.deriv(k)(s) if k else _RISE(s), lead) / self.duration**k for k in range(3)]
        return rise[0] + np.array(self.begin), rise[1], rise[2]

    def angles(self, times: np.ndarray) -> np.ndarray:
        """Of a rigid arm in rad, then their two derivatives, shape (n, 6)."""
        p, v, a = self.at(times)
        elbow = -np.arccos(0.5 * (p * p).sum(axis=1) - 1.0)
        first = np.arctan2(p[:, 1], p[:, 0]) - 0.5 * elbow
        both = first + elbow
        J = np.empty((len(p), 2, 2))
        J[:, 0, 1], J[:, 1, 1] = -np.sin(both), np.cos(both)
        J[:, 0, 0], J[:, 1, 0] = J[:, 0, 1] - np.sin(first), J[:, 1, 1] + np.cos(first)
        rate = np.linalg.solve(J, v[..., None])[..., 0]
        squares = np.stack([rate[:, 0], rate.sum(axis=1)]) ** 2
        inward = np.stack([squares[0] * f(first) + squares[1] * f(both) for f in (np.cos, np.sin)], axis=1)
        acceleration = np.linalg.solve(J, (a + inward)[..., None])[..., 0]
        return np.hstack([np.stack([first, elbow], axis=1), rate, acceleration])
