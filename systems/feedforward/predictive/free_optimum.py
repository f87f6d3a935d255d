"""The optimum of the predictive correction where no bound is in its way: linear in the forecast."""

import numpy as np

from systems.feedforward.predictive.forecast import Cascade, Forecast


class FreeOptimum:
    """Solves the program of `CorrectionProgram` without its bounds.

    The errors of a motor determine its corrections, u = r - A e with a triangular A, so the errors are the
    unknowns of a linear least-squares problem, of which some ticks are known. There are few ticks, and six
    small dense problems at once take less time than anything sparse.
    """

    def __init__(self, cascade: Cascade, smoothness: float, period: float, ticks: int) -> None:
        """Lays out what does not change from tick to tick; arguments as of `CorrectionProgram`."""
        one, before, sums = np.eye(ticks), np.eye(ticks, k=-1), np.tri(ticks)
        self._rate = (one - before) / period
        self._acceleration = (one - 2.0 * before + np.eye(ticks, k=-2)) / period**2
        self._drive = cascade.proportional * one + cascade.integral * period * sums
        self._damping, self._period = cascade.derivative, period
        self._change = smoothness * (np.eye(ticks - 1, ticks, k=1) - np.eye(ticks - 1, ticks))

    def solve(self, forecast: Forecast) -> np.ndarray:
        """The corrections in rad/s^2 at all ticks, (n, 6), whose first ticks are under way already."""
        f, T = forecast, self._period
        under_way = int(np.argmin((f.lower == f.upper).all(axis=1)))
        damping = (self._damping + f.friction_slope.T)[:, :, None]
        A = f.inertia[:, None, None] * self._acceleration + damping * self._rate + self._drive
        r = f.disturbance.T - f.integral[:, None]
        r[:, 0] += (f.inertia / T**2 + damping[:, 0, 0] / T) * f.error + f.inertia / T * f.error_rate
        r[:, 1] -= f.inertia / T**2 * f.error
        u = np.empty_like(r)
        u[:, :under_way] = f.lower[:under_way].T
        known, free = slice(under_way), slice(under_way, None)
        e_known = np.linalg.solve(A[:, known, known], (r - u)[:, known, None])
        s = r[:, free, None] - A[:, free, known] @ e_known  # what u would be without further errors
        A = A[:, free, free]
        change = self._change[:, free] @ A
        wanted = self._change[:, free] @ s + self._change[:, known] @ u[:, known, None]
        normal = np.eye(A.shape[1]) + change.swapaxes(1, 2) @ change
        e = np.linalg.solve(normal, change.swapaxes(1, 2) @ wanted)
        u[:, free] = (s - A @ e)[:, :, 0]
        return u.T
