"""A path of the tool in time: pieces of which each is run from rest to rest."""

import math
from bisect import bisect_right
from typing import overload

import numpy as np

from systems.reference.segment import Segment, weights
from systems.reference.timing import Profile


class OutOfReachError(RuntimeError):
    """A path that the robot does not reach, as has turned out in a run."""


class CartesianPath:
    """The desired pose, twist and acceleration of the tool at any time.

    Attributes:
        path_start: s, the path begins (the settling time is over).
        lap_starts: s, shape (laps,), each lap begins; the first one with the path.
        dwell_start: s, the last pose is reached.
        duration: s, the path is over: settling, motion and dwell.
        continuous_derivatives: how many time derivatives of the pose do not jump anywhere.
    """

    def __init__(
        self,
        segments: list[Segment],
        profile: Profile,
        settle: float,
        dwell: float,
        hold: float,
        laps: int = 1,
    ) -> None:
        """Lays the segments out in time.

        Args:
            segments: in their order, the end of one being the start of the next.
            profile: s(t) on every segment.
            settle: s before the path begins.
            dwell: s at rest at the end.
            hold: s at rest before each segment.
            laps: how often all segments are run.
        """
        self.path_start = settle
        self.lap_starts = settle + np.arange(laps) * len(segments) * (profile.duration + hold)
        segments = segments * laps
        self._starts = [settle + hold + i * (profile.duration + hold) for i in range(len(segments))]
        self.dwell_start = self._starts[-1] + profile.duration
        self.duration = self.dwell_start + dwell
        self.continuous_derivatives = profile.continuous_derivatives  # segments are analytic in s
        self._profile = profile
        self._segments = segments
        self._start_times = np.array(self._starts)
        self._angles = np.array([segment.angle for segment in segments])
        self._poses = np.array([segment.pose for segment in segments])
        self._twists = np.array([segment.twist for segment in segments])

    @property
    def lap_end(self) -> float:
        """When the first lap is over, s; all others are the same."""
        return float(self.lap_starts[1]) if len(self.lap_starts) > 1 else self.dwell_start

    @overload
    def sample(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
    @overload
    def sample(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
    def sample(self, time):
        """Where the tool shall be, at rest before the path begins and after it ends.

        Args:
            time: s, one number or an array of shape (...).

        Returns:
            X_WE (..., 4, 4), the spatial velocity V_WE (..., 6) and the spatial acceleration A_WE (..., 6) of
            the tool's origin in the world; rotation (rad/s, rad/s^2) first, then translation (m/s, m/s^2).
        """
        if np.ndim(time):
            return self._sample_many(np.asarray(time, dtype=float))
        i = max(bisect_right(self._starts, time) - 1, 0)
        angle, pose, twist = self._segments[i]
        s, rate, acceleration = self._profile.at(time - self._starts[i])
        u = angle * s
        of_pose, of_V, of_A = weights(angle, s, rate, acceleration, math.sin(u), math.cos(u))
        V, A = np.array((of_V, of_A)) @ twist
        return (np.array(of_pose) @ pose).reshape(4, 4), V, A

    def _sample_many(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        i = np.maximum(np.searchsorted(self._start_times, times, side="right") - 1, 0)
        s, rate, acceleration = self._profile.at_times(times - self._start_times[i])
        angle = self._angles[i]
        u = angle * s
        of_pose, of_V, of_A = (
            np.stack(np.broadcast_arrays(*functions), -1)[..., None, :]
            for functions in weights(angle, s, rate, acceleration, np.sin(u), np.cos(u))
        )
        X = (of_pose @ self._poses[i])[..., 0, :].reshape(*times.shape, 4, 4)
        twists = self._twists[i]
        return X, (of_V @ twists)[..., 0, :], (of_A @ twists)[..., 0, :]
