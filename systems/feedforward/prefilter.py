"""Low-pass filters that make a reference smooth and give its derivatives, at the price of a known delay."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from robots.configuration.quantity import choice, quantity

KINDS = ("none", "critically_damped", "bessel")


@dataclass
class PrefilterConfig:
    """How a reference becomes differentiable; read from a scenario file.

    ``none`` is for a reference that is known in advance, with its derivatives.
    """

    kind: str = choice("none", KINDS)  # none, critically_damped or bessel
    order: int = quantity(4, 1, 10)  # the highest derivative that it gives
    # Corner of each stage if critically damped; -3 dB of a Bessel filter
    cutoff_hz: float = quantity(20.0, 0.0, 1000.0, "Hz", is_open=True)


class Prefilter:
    """A chain of integrators whose states are the filtered signals and their derivatives.

    Critically damped: n equal lags of 1 / w_c, Reiner (2010) eq. (3.32). In these coordinates the derivatives
    (3.33) need no recursion. The filter is discretised exactly for a signal that is linear within a tick.
    """

    def __init__(self, config: PrefilterConfig, period: float, needed: int = 0, user: str = "") -> None:
        """Designs the filter.

        Args:
            config: kind, order and cutoff.
            period: tick in s.
            needed: the highest derivative that will be taken.
            user: who takes it, for the message.

        Raises:
            ValueError: if the kind is unknown, the cutoff is not positive or the order is too low.
        """
        if config.kind not in KINDS[1:]:
            raise ValueError(f"prefilter: kind must be one of {', '.join(KINDS)}, got '{config.kind}'")
        if not 0.0 < config.cutoff_hz < np.inf:
            raise ValueError(f"prefilter: cutoff_hz must be positive, got {config.cutoff_hz} Hz")
        if config.order < max(1, needed):
            raise ValueError(
                f"prefilter: order must be at least {max(1, needed)}, got {config.order}"
                + (f": {user} takes derivatives of its reference up to that order" if needed else "")
            )
        self.order = config.order
        cutoff = 2.0 * np.pi * config.cutoff_hz
        if config.kind == "bessel":
            from scipy.signal import besselap  # here: half a second that few need

            poles = besselap(config.order, norm="mag")[1] * cutoff
        else:
            poles = np.full(config.order, -cutoff)
        # y^(n) = a_0 (u - y) - a_1 y' - ... - a_(n-1) y^(n-1)
        self._feedback = np.poly(poles).real[:0:-1]
        self._held, self._start, self._end = self._discretised(period)

    @property
    def delay(self) -> float:
        """How late slow signals are, in s: the group delay at zero frequency."""
        return float(self._feedback[1] / self._feedback[0]) if self.order > 1 else 1.0 / self._feedback[0]

    def at_rest(self, value: np.ndarray) -> np.ndarray:
        """States of filters that have always been fed these values (n,); shape (order, n)."""
        state = np.zeros((self.order, len(value)))
        state[0] = value
        return state

    def step(self, state: np.ndarray, before: np.ndarray, now: np.ndarray) -> np.ndarray:
        """The states one tick later.

        Args:
            state: filtered signals and their derivatives up to the order less one, shape (order, n).
            before: the signals at the last tick, shape (n,).
            now: the signals now.
        """
        return self._held @ state + self._start[:, None] * before + self._end[:, None] * now

    def highest_derivative(self, state: np.ndarray, now: np.ndarray) -> np.ndarray:
        """The derivative of the filter's order, shape (n,), which jumps where the signal jumps."""
        return self._feedback[0] * now - self._feedback @ state

    def _discretised(self, period: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Weights of the last state, of the signal at the last tick and of the signal now."""
        n = self.order
        # The signal and its rate of change are two more states.
        A = np.zeros((n + 2, n + 2))
        A[: n - 1, 1:n] = np.eye(n - 1)
        A[n - 1, :n], A[n - 1, n] = -self._feedback, self._feedback[0]
        A[n, n + 1] = 1.0 / period
        # A balanced matrix: in units of a tick the derivatives are of one size.
        scale = period ** np.arange(n + 2.0)
        scale[n:] = 1.0
        step = expm(A * period * scale[:, None] / scale) / scale[:, None] * scale
        return step[:n, :n], step[:n, n] - step[:n, n + 1], step[:n, n + 1]
