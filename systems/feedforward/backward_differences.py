"""Derivatives of a signal at its newest sample, from it and the few samples before."""

import numpy as np

HISTORY = 3  # how many earlier samples are needed
# Of the newest sample and the three before it: exact for polynomials of third degree.
_FIRST = np.array([11.0, -18.0, 9.0, -2.0]) / 6.0
_SECOND = np.array([2.0, -5.0, 4.0, -1.0])


class BackwardDifferences:
    """First and second derivatives of vectors that come once a tick, exact for cubic polynomials.

    A plain difference of two samples is the derivative half a tick ago, and its difference the second
    derivative a whole tick ago; what these leave is of the third and of the second order in the tick.
    """

    def __init__(self, period: float) -> None:
        """Scales the weights; the period is in s."""
        self._weights = np.array([_FIRST / period, _SECOND / period**2])

    def derivatives(self, newest: np.ndarray, history: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivative at the newest sample.

        Args:
            newest: sample, shape (n,).
            history: the samples before it, the younger ones first, shape (HISTORY, n).
        """
        first, second = self._weights[:, :1] * newest + self._weights[:, 1:] @ history
        return first, second


def at_rest(sample: np.ndarray) -> np.ndarray:
    """The history of a signal that has always been what it is now, shape (HISTORY, n)."""
    return np.tile(sample, (HISTORY, 1))


def with_newest(newest: np.ndarray, history: np.ndarray) -> np.ndarray:
    """The history one tick later."""
    return np.concatenate([newest[None], history[:-1]])
