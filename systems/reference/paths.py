"""Paths of the tool in the world: their geometry, their timing, and the configuration they are made from.

A path is a row of segments. Along each of them a parameter s runs with the sin^2 acceleration profile
from rest to rest: over one straight line from way point to way point, or over the turns of a closed curve.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple, overload

import numpy as np

from robots.configuration.quantity import quantity
from robots.pose import rotation_from_zyx, rotation_vector

_CLOSED = 1e-9  # m and rad, the ends of a path that is closed are that near to each other


@dataclass
class Waypoint:
    """A pose of the tool in the world: translation in mm, ZYX angles (alpha, beta, gamma) in degrees."""

    translation_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))
    zyx_deg: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass
class CircleConfig:
    """A circle in the xy plane of a frame at its center; it starts on that frame's x axis, towards y."""

    center_mm: np.ndarray = field(default_factory=lambda: np.array([450.0, 0.0, 400.0]))
    radius_mm: float = 100.0
    plane_zyx_deg: np.ndarray = field(default_factory=lambda: np.zeros(3))  # of the frame of the plane
    zyx_deg: np.ndarray = field(default_factory=lambda: np.array([90.0, 0.0, 90.0]))  # of the tool, constant
    turns: int = 1


@dataclass
class FigureEightConfig:
    """A figure eight (lemniscate of Gerono) along the x axis of the frame of its plane.

    It starts at the crossing, towards +x and +y, and its curvature is continuous.
    """

    center_mm: np.ndarray = field(default_factory=lambda: np.array([450.0, 0.0, 400.0]))
    length_mm: float = 200.0  # from end to end, along x of the plane
    width_mm: float = 100.0  # of one loop, along y of the plane
    plane_zyx_deg: np.ndarray = field(default_factory=lambda: np.array([90.0, 0.0, 0.0]))
    zyx_deg: np.ndarray = field(default_factory=lambda: np.array([90.0, 0.0, 90.0]))  # of the tool, constant
    turns: int = 1


def rectangle_waypoints() -> list[Waypoint]:
    """The test path of Probst (2024), table 5.1, in the base frame of the robot (corrected)."""
    corners = [(350, 450, 180), (550, 450, 90), (550, -450, 0), (350, -450, 90), (350, 450, 180)]
    return [Waypoint(np.array([x, y, 400.0]), np.array([alpha, 0.0, 90.0])) for x, y, alpha in corners]


@dataclass
class ReferenceConfig:
    """Which path the tool shall take, and when; read from a scenario file."""

    path: str = "rectangle"  # "rectangle", "circle", "figure_eight" or "points"
    # k_a, peak acceleration in segments (or turns) per s^2
    acceleration: float = quantity(0.7, 1e-3, 100.0, "1/s^2")
    settle: float = quantity(0.0, 0.0, 600.0, "s")  # at the start pose before the path begins
    dwell: float = quantity(2.0, 0.0, 600.0, "s")  # at rest at the end; with "points" at every point
    # How often the path is run, one after the other; more than once it must be closed
    laps: int = quantity(1, 1, 10000)
    preview: float = quantity(0.0, 0.0, 1.0, "s")  # that the preview ports of the Reference look ahead
    waypoints: list[Waypoint] = field(default_factory=rectangle_waypoints)  # of "rectangle" and "points"
    circle: CircleConfig = field(default_factory=CircleConfig)
    figure_eight: FigureEightConfig = field(default_factory=FigureEightConfig)


class SineSquaredProfile:
    """s(t) from 0 to ``length``, rest to rest, with two sin^2 humps of acceleration, Probst (2024) eq. (5.2).

    Each hump lasts T = sqrt(2 length / k_a); the speed peaks between them at sqrt(k_a length / 2).
    """

    def __init__(self, acceleration: float, length: float = 1.0) -> None:
        self.length = length
        self.hump = math.sqrt(2.0 * length / acceleration)  # s
        self.duration = 2.0 * self.hump  # s
        self._acceleration = acceleration
        self._frequency = math.pi / self.hump  # rad/s

    def at(self, t: float) -> tuple[float, float, float]:
        """s, ds/dt and d2s/dt2, t seconds after the start; at rest before the start and after the end."""
        if t <= 0.0:
            return 0.0, 0.0, 0.0
        if t >= self.duration:
            return self.length, 0.0, 0.0
        if t <= self.hump:
            u = self._frequency * t
            return self._first_hump(t, math.sin(u), math.cos(u))
        t = self.duration - t
        u = self._frequency * t
        s, rate, acceleration = self._first_hump(t, math.sin(u), math.cos(u))
        return self.length - s, rate, -acceleration

    def at_times(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same for an array of times of any shape."""
        t = np.clip(t, 0.0, self.duration)
        second = t > self.hump
        t = np.where(second, self.duration - t, t)
        u = self._frequency * t
        s, rate, acceleration = self._first_hump(t, np.sin(u), np.cos(u))
        return np.where(second, self.length - s, s), rate, np.where(second, -acceleration, acceleration)

    def _first_hump(self, t, sine, cosine):
        """Eq. (5.2) and its two integrals up to t <= T; the second hump is its mirror image in time."""
        half, q = 0.5 * self._acceleration, sine / self._frequency
        return 0.5 * half * (t * t - q * q), half * (t - q * cosine), 2.0 * half * sine * sine


class Segment(NamedTuple):
    """A piece of a path as a sum of the five functions 1, s, sin(a s), cos(a s) and sin(2 a s).

    They span all that is needed: straight lines with a rotation about a fixed axis, circles, figure eights.
    """

    angle: float  # a in rad
    pose: np.ndarray  # (5, 16), the coefficients of the entries of X_WE, row by row
    twist: np.ndarray  # (4, 6), of the last four functions: (rotation vector, translation) in rad and m


def _segment(
    angle: float, rotation: dict[int, np.ndarray], translation: dict[int, np.ndarray], turn: np.ndarray
) -> Segment:
    """Puts coefficients in their places; ``turn`` is dR/ds R^T as a vector, constant, in rad."""
    pose, twist = np.zeros((5, 4, 4)), np.zeros((5, 6))
    pose[0, 3, 3] = 1.0
    for i, matrix in rotation.items():
        pose[i, :3, :3] = matrix
    for i, vector in translation.items():
        pose[i, :3, 3] = vector
        twist[i, 3:] = vector
    twist[1, :3] = turn
    return Segment(angle, pose.reshape(5, 16), twist[1:])


def line(X_start: np.ndarray, X_end: np.ndarray) -> Segment:
    """From pose to pose (both (4, 4)) for s from 0 to 1: straight, turning about an axis fixed in the world.

    Probst (2024), eqs. (5.3) and (5.4), corrected: R(s) = exp(e~ phi s) R_start. As e does not move, eq.
    (5.6) comes down to w = e phi ds/dt.
    """
    R = X_start[:3, :3]
    turn = rotation_vector(X_end[:3, :3] @ R.T)
    angle = float(np.linalg.norm(turn))
    skew = np.cross(np.eye(3), turn / angle if angle > 0.0 else turn)
    rotation = {0: R + skew @ skew @ R, 2: skew @ R, 3: -skew @ skew @ R}
    return _segment(angle, rotation, {0: X_start[:3, 3], 1: X_end[:3, 3] - X_start[:3, 3]}, turn)


def _circle(config: CircleConfig) -> Segment:
    x_axis, y_axis = _rotation(config.plane_zyx_deg).T[:2]
    radius = 1e-3 * config.radius_mm
    translation = {0: 1e-3 * np.asarray(config.center_mm), 3: radius * x_axis, 2: radius * y_axis}
    return _segment(2.0 * math.pi, {0: _rotation(config.zyx_deg)}, translation, np.zeros(3))


def _figure_eight(config: FigureEightConfig) -> Segment:
    x_axis, y_axis = _rotation(config.plane_zyx_deg).T[:2]
    half_length, half_width = 0.5e-3 * config.length_mm, 0.5e-3 * config.width_mm
    translation = {0: 1e-3 * np.asarray(config.center_mm), 2: half_length * x_axis, 4: half_width * y_axis}
    return _segment(2.0 * math.pi, {0: _rotation(config.zyx_deg)}, translation, np.zeros(3))


def _rotation(zyx_deg: np.ndarray) -> np.ndarray:
    return rotation_from_zyx(np.deg2rad(zyx_deg))


def _waypoint_pose(waypoint: Waypoint) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = _rotation(waypoint.zyx_deg)
    X[:3, 3] = 1e-3 * np.asarray(waypoint.translation_mm)
    return X


def _weights(angle, s, rate, acceleration, sine, cosine):
    """The five functions, and the first and second time derivative of the last four, by the chain rule."""
    double_sine, double_cosine = 2.0 * sine * cosine, 1.0 - 2.0 * sine * sine
    w, dw = angle * rate, angle * acceleration
    ww = w * w
    return (
        (1.0, s, sine, cosine, double_sine),
        (rate, w * cosine, -w * sine, 2.0 * w * double_cosine),
        (
            acceleration,
            dw * cosine - ww * sine,
            -dw * sine - ww * cosine,
            2.0 * dw * double_cosine - 4.0 * ww * double_sine,
        ),
    )


class CartesianPath:
    """The desired pose, twist and acceleration of the tool at any time. Make one with `make_path`.

    Attributes:
        path_start: s, the path begins (the settling time is over).
        lap_starts: s, shape (laps,), each lap begins; the first one with the path.
        dwell_start: s, the last pose is reached.
        duration: s, the path is over: settling, motion and dwell.
    """

    def __init__(
        self,
        segments: list[Segment],
        profile: SineSquaredProfile,
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
        of_pose, of_V, of_A = _weights(angle, s, rate, acceleration, math.sin(u), math.cos(u))
        V, A = np.array((of_V, of_A)) @ twist
        return (np.array(of_pose) @ pose).reshape(4, 4), V, A

    def _sample_many(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        i = np.maximum(np.searchsorted(self._start_times, times, side="right") - 1, 0)
        s, rate, acceleration = self._profile.at_times(times - self._start_times[i])
        angle = self._angles[i]
        u = angle * s
        of_pose, of_V, of_A = (
            np.stack(np.broadcast_arrays(*functions), -1)[..., None, :]
            for functions in _weights(angle, s, rate, acceleration, np.sin(u), np.cos(u))
        )
        X = (of_pose @ self._poses[i])[..., 0, :].reshape(*times.shape, 4, 4)
        twists = self._twists[i]
        return X, (of_V @ twists)[..., 0, :], (of_A @ twists)[..., 0, :]


def make_path(config: ReferenceConfig) -> CartesianPath:
    """The path that a configuration describes.

    Straight lines take 2 sqrt(2 / k_a) each. A circle or a figure eight of n turns is one motion from rest to
    rest, s counting turns, so that it takes 2 sqrt(2 n / k_a).

    Raises:
        ValueError: if the configuration names no path or an impossible one.
    """
    maker = _MAKERS.get(config.path)
    if maker is None:
        raise ValueError(f"reference: path must be one of {', '.join(_MAKERS)}, got '{config.path}'")
    _require_positive("acceleration", config.acceleration, "1/s^2")
    for name in ("settle", "dwell", "preview"):
        value = getattr(config, name)
        if not 0.0 <= value < math.inf:
            raise ValueError(f"reference: {name} must be finite and not negative, got {value} s")
    if not 1 <= config.laps < math.inf or config.laps != int(config.laps):
        raise ValueError(f"reference: laps must be a whole number from 1 on, got {config.laps}")
    path = maker(config)
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
            f"'{config.path}' are {1e3 * distance:.3g} mm and {math.degrees(angle):.3g} deg apart"
        )


def _pose_distance(X: np.ndarray, Y: np.ndarray) -> tuple[float, float]:
    """Metres and radians between two poses (4, 4)."""
    turn = rotation_vector(X[:3, :3] @ Y[:3, :3].T)
    return float(np.linalg.norm(X[:3, 3] - Y[:3, 3])), float(np.linalg.norm(turn))


def _through_waypoints(config: ReferenceConfig, hold: float = 0.0) -> CartesianPath:
    if len(config.waypoints) < 2:
        raise ValueError(
            f"reference: path '{config.path}' needs at least two waypoints, got {len(config.waypoints)}"
        )
    for number, waypoint in enumerate(config.waypoints, 1):
        _require_vectors(f"waypoint {number}", waypoint, "translation_mm", "zyx_deg")
    poses = [_waypoint_pose(waypoint) for waypoint in config.waypoints]
    segments = [line(start, end) for start, end in pairwise(poses)]
    profile = SineSquaredProfile(config.acceleration)
    return CartesianPath(segments, profile, config.settle, config.dwell, hold, config.laps)


def _points(config: ReferenceConfig) -> CartesianPath:
    return _through_waypoints(config, hold=config.dwell)


def _around_circle(config: ReferenceConfig) -> CartesianPath:
    _require_positive("circle radius_mm", config.circle.radius_mm, "mm")
    return _around(config, "circle", config.circle, _circle)


def _around_figure_eight(config: ReferenceConfig) -> CartesianPath:
    _require_positive("figure_eight length_mm", config.figure_eight.length_mm, "mm")
    _require_positive("figure_eight width_mm", config.figure_eight.width_mm, "mm")
    return _around(config, "figure_eight", config.figure_eight, _figure_eight)


def _around(config: ReferenceConfig, name: str, curve, segment: Callable[..., Segment]) -> CartesianPath:
    _require_vectors(name, curve, "center_mm", "plane_zyx_deg", "zyx_deg")
    if not 1 <= curve.turns < math.inf or curve.turns != int(curve.turns):
        raise ValueError(f"reference: {name} turns must be a whole number from 1 on, got {curve.turns}")
    profile = SineSquaredProfile(config.acceleration, float(curve.turns))
    return CartesianPath([segment(curve)], profile, config.settle, config.dwell, 0.0, config.laps)


def _require_positive(name: str, value: float, unit: str) -> None:
    if not 0.0 < value < math.inf:
        raise ValueError(f"reference: {name} must be finite and positive, got {value} {unit}")


def _require_vectors(where: str, part: object, *names: str) -> None:
    for name in names:
        value = np.asarray(getattr(part, name), dtype=float)
        if value.shape != (3,) or not np.all(np.isfinite(value)):
            raise ValueError(f"reference: {where} {name} must be three finite numbers, got {value.tolist()}")


_MAKERS: dict[str, Callable[[ReferenceConfig], CartesianPath]] = {
    "rectangle": _through_waypoints,
    "circle": _around_circle,
    "figure_eight": _around_figure_eight,
    "points": _points,
}
