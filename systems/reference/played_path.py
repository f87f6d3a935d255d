"""A path as it was run: at which times of the station which part of it was due."""

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from systems.reference.paths import CartesianPath


class PlayedPath:
    """A path against the station's time, from a record of the time on the path.

    Attributes:
        path_start, dwell_start, duration: s of the station, as of a `CartesianPath`; what had not begun when
            the record ends is due as much later as it then had to go at the planned speed.
        lap_starts: s of the station, shape (laps,).
        path_time: s on the path at the times of the record, shape (n,).
    """

    def __init__(self, path: CartesianPath, times: np.ndarray, path_time: np.ndarray) -> None:
        """Takes the record.

        Args:
            path: as planned.
            times: s of the station, increasing, shape (n,), n > 0.
            path_time: s on the path then and its rate, shape (n, 2).
        """
        self._path, self._times, self.path_time = path, times, path_time[:, 0]
        self._at = None
        if len(times) > 1 and not np.array_equal(times, path_time[:, 0]):
            self._at = CubicHermiteSpline(times, path_time[:, 0], path_time[:, 1])
        self.path_start, self.dwell_start, self.duration = (
            self._when(mark) for mark in (path.path_start, path.dwell_start, path.duration)
        )
        self.lap_starts = np.array([self._when(start) for start in path.lap_starts])

    @property
    def is_slowed(self) -> bool:
        """Whether the path was not run as it is planned all the time."""
        return self._at is not None

    def sample(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where the tool was to be at times of the station in s, as `CartesianPath.sample` has it."""
        if self._at is None:
            return self._path.sample(t)
        inside = np.clip(t, self._times[0], self._times[-1])
        s = self._at(inside) + (t - inside)
        rate, acceleration = self._at(inside, 1)[:, None], self._at(inside, 2)[:, None]
        X_WE, V_WE, A_WE = self._path.sample(s)
        return X_WE, rate * V_WE, rate**2 * A_WE + acceleration * V_WE

    def _when(self, s: float) -> float:
        """The time of the station in s at which the path came to s seconds."""
        if self._at is None:
            return s
        reached = self.path_time >= s - 1e-9
        if not reached.any():
            return float(self._times[-1] + s - self.path_time[-1])
        return float(self._times[np.argmax(reached)])
