"""Paths of the tool in the world: their geometry, their timing, and the configuration they are made from.

A path is a row of segments. Along each of them a parameter s runs from rest to rest with a profile of
`systems.reference.timing`: over one straight line from way point to way point, or over the turns of a closed
curve.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import overload

import numpy as np

from robots.configuration.quantity import choice, quantity
from robots.pose import rotation_vector
from systems.reference.segment import Segment, weights
from systems.reference.shapes import Rectangle, Shape
from systems.reference.timing import TIMINGS, Profile

_CLOSED = 1e-9  # m and rad, the ends of a path that is closed are that near to each other


@dataclass
class SpeedOverride:
    """From a time on the path is run at a share of its planned speed: a controller's override."""

    at: float = quantity(0.0, 0.0, 1e6, "s")
    share: float = quantity(1.0, 0.0, 1.0)


@dataclass
class ReferenceConfig:
    """Which path the tool shall take, and when; read from a scenario file."""

    path: Shape = field(default_factory=Rectangle)
    # k_a, peak acceleration in segments (or turns) per s^2
    acceleration: float = quantity(0.7, 1e-3, 100.0, "1/s^2")
    # sine_squared has three continuous derivatives, polynomial five, as an elastic structure needs them
    timing: str = choice("sine_squared", tuple(TIMINGS))
    settle: float = quantity(0.0, 0.0, 600.0, "s")  # at the start pose before the path begins
    dwell: float = quantity(2.0, 0.0, 600.0, "s")  # at rest at the end; with "points" at every point
    # How often the path is run, one after the other; more than once it must be closed
    laps: int = quantity(1, 1, 10000)
    preview: float = quantity(0.0, 0.0, 1.0, "s")  # that the preview ports of the Reference look ahead
    slowing: float = quantity(0.5, 0.05, 10.0, "s")  # from one speed to another
    override: list[SpeedOverride] = field(default_factory=list)


class CartesianPath:
    """The desired pose, twist and acceleration of the tool at any time. Make one with `make_path`.

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


def make_path(config: ReferenceConfig) -> CartesianPath:
    """The path that a configuration describes.

    Straight lines take 2 sqrt(2 / k_a) each, a fifth more with the polynomial. A circle or a figure eight of
    n turns is one motion from rest to rest, s counting turns, so that it takes sqrt(n) times as long.

    Raises:
        ValueError: if the configuration names no path or an impossible one.
    """
    _require_positive("acceleration", config.acceleration, "1/s^2")
    for name in ("settle", "dwell", "preview"):
        value = getattr(config, name)
        if not 0.0 <= value < math.inf:
            raise ValueError(f"reference: {name} must be finite and not negative, got {value} s")
    if not 1 <= config.laps < math.inf or config.laps != int(config.laps):
        raise ValueError(f"reference: laps must be a whole number from 1 on, got {config.laps}")
    if config.timing not in TIMINGS:
        raise ValueError(f"reference: timing must be one of {', '.join(TIMINGS)}, got '{config.timing}'")
    shape = config.path
    segments = shape.segments()
    profile = TIMINGS[config.timing](config.acceleration, shape.length)
    hold = config.dwell if shape.rests else 0.0
    path = CartesianPath(segments, profile, config.settle, config.dwell, hold, config.laps)
    if config.laps > 1:
        _require_closed(config, path)
    return path


def _require_closed(config: ReferenceConfig, path: CartesianPath) -> None:
    """Refuses laps of a path that does not end where it starts: the tool would have to jump."""
    start, end = path.sample(np.array([0.0, path.dwell_start]))[0]
    distance, angle = _pose_distance(start, end)
    if distance > _CLOSED or angle > _CLOSED:
        raise ValueError(
            f"reference: {config.laps} laps need a path that ends where it starts, but the ends of "
            f"'{config.path.kind}' are {1e3 * distance:.3g} mm and {math.degrees(angle):.3g} deg apart"
        )


def _pose_distance(X: np.ndarray, Y: np.ndarray) -> tuple[float, float]:
    """Metres and radians between two poses (4, 4)."""
    turn = rotation_vector(X[:3, :3] @ Y[:3, :3].T)
    return float(np.linalg.norm(X[:3, 3] - Y[:3, 3])), float(np.linalg.norm(turn))


def _require_positive(name: str, value: float, unit: str) -> None:
    if not 0.0 < value < math.inf:
        raise ValueError(f"reference: {name} must be finite and positive, got {value} {unit}")
