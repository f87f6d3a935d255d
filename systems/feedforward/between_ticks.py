"""How the links move between two ticks and half a tick beyond, for steps that are finer than ticks."""

import math

import numpy as np

_POWERS = np.arange(6.0)


class BetweenTicks:
    """The polynomial of fifth degree through position, velocity and acceleration at two ticks.

    Of a smooth reference it misses position by the sixth power of the tick and acceleration by the fourth:
    at 4 ms and 5 Hz by a millionth of a percent and by less than a thousandth of a percent, also half a tick
    beyond the newer one.

    Attributes:
        substep: s, from one sub-step to the next.
        half: sub-steps in half a tick. They begin half a tick before the newer tick and end half a tick after
            it, where a torque that is held until the next tick is in its middle.
    """

    def __init__(self, period: float, longest: float) -> None:
        """Divides half a tick into equal parts.

        Args:
            period: tick in s.
            longest: that a sub-step may be in s.
        """
        self.half = max(1, math.ceil(0.5 * period / longest - 1e-9))
        self.substep = 0.5 * period / self.half
        # In units of a tick, zero at the newer one.
        ends = np.concatenate([_derivatives(-1.0), _derivatives(0.0)])
        times = np.arange(1 - self.half, self.half + 1) / (2.0 * self.half)
        weights = np.array([_derivatives(time) for time in times]) @ np.linalg.inv(ends)
        units = period ** np.arange(3.0)
        self._weights = weights / units[:, None] * np.tile(units, 2)
        self._period = period

    def references(self, last: np.ndarray, now: np.ndarray) -> np.ndarray:
        """Positions, velocities and accelerations at the ends of all sub-steps, shape (2 half, 3, n).

        Args:
            last: the three at the last tick, shape (3, n); NaN if there was none, and the links have moved
                with constant acceleration.
            now: at this tick.
        """
        if np.isnan(last[0, 0]):
            T = self._period
            last = np.stack([-T * now[1] + 0.5 * T * T * now[2], now[1] - T * now[2], now[2]])
        else:
            last = last.copy()
            last[0] -= now[0]
        # From the newer position, so that rounding of it does not reach the accelerations.
        here = now.copy()
        here[0] = 0.0
        between = self._weights @ np.concatenate([last, here])
        between[:, 0] += now[0]
        between[self.half - 1] = now
        return between


def _derivatives(time: float) -> np.ndarray:
    """Of the six powers at a time: value, first and second derivative; shape (3, 6)."""
    rows = np.zeros((3, 6))
    rows[0] = time**_POWERS
    rows[1, 1:] = _POWERS[1:] * time ** _POWERS[:5]
    rows[2, 2:] = _POWERS[2:] * _POWERS[1:5] * time ** _POWERS[:4]
    return rows
