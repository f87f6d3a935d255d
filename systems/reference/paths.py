"""Paths of the tool in the world: their geometry, their timing, and the configuration they are made from.

A path is a row of segments. Along each of them a parameter s runs from rest to rest with a profile of
`systems.reference.timing`: over one straight line from way point to way point, or over the turns of a closed
curve.
"""

import math
from dataclasses import dataclass, field
from typing import get_args

import numpy as np

from robots.configuration.quantity import choice, quantity
from robots.pose import rotation_vector
from systems.reference.cartesian_path import CartesianPath
from systems.reference.planned_path import PlannedPath
from systems.reference.shapes import Circle, FigureEight, Planned, Points, Rectangle, Shape
from systems.reference.timing import TIMINGS

_CLOSED = 1e-9  # m and rad, the ends of a path that is closed are that near to each other


@dataclass
class SpeedOverride:
    """From a time on the path is run at a share of its planned speed: a controller's override."""

    at: float = quantity(0.0, 0.0, 1e6, "s")  # since the start of the run
    share: float = quantity(1.0, 0.0, 1.0)  # of the planned speed, from then on; 0 holds the tool


@dataclass
class ReferenceConfig:
    """Which path the tool shall take, and when; read from a scenario file."""

    path: Shape = field(default_factory=Rectangle)  # the shape, or a planned motion
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
    # Changes of speed during the run; empty for the planned speed
    override: list[SpeedOverride] = field(default_factory=list)


def make_path(config: ReferenceConfig) -> CartesianPath:
    """The path that a configuration describes.

    Straight lines take 2 sqrt(2 / k_a) each, a fifth more with the polynomial. A circle or a figure eight of
    n turns is one motion from rest to rest, s counting turns, so that it takes sqrt(n) times as long. A
    planned path has its own timing.

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
    if isinstance(shape, type) or not (hasattr(shape, "segments") or isinstance(shape, Planned)):
        kinds = ", ".join(each.__name__ for each in get_args(Shape))  # or one of one's own
        raise ValueError(f"reference: path must be a {kinds} of systems.reference.shapes, got {shape!r}")
    if isinstance(shape, Planned):
        path: CartesianPath = PlannedPath(shape.motion(), config.settle, config.dwell, config.laps)
    else:
        path = _timed(config, shape)
    if config.laps > 1:
        _require_closed(config, path)
    return path


def _timed(config: ReferenceConfig, shape: Rectangle | Circle | FigureEight | Points) -> CartesianPath:
    segments = shape.segments()
    profile = TIMINGS[config.timing](config.acceleration, shape.length)
    hold = config.dwell if shape.rests else 0.0
    return CartesianPath(segments, profile, config.settle, config.dwell, hold, config.laps)


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
