"""Stamped measurements as they travel on abstract ports."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from robots.description.model import NUM_JOINTS


@dataclass(frozen=True, slots=True)
class JointSample:
    """What a robot controller reports of its joints, all on the motor side but seen behind the gear."""

    time: float = 0.0  # s
    position: np.ndarray = field(default_factory=lambda: np.zeros(NUM_JOINTS))  # rad
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(NUM_JOINTS))  # rad/s
    effort: np.ndarray = field(default_factory=lambda: np.zeros(NUM_JOINTS))  # N m, joint side
    running: bool = False  # motors are on and follow commands


@dataclass(frozen=True, slots=True)
class PoseSample:
    """What a camera system reports of the tool. ``time`` is the exposure, not the arrival."""

    time: float = -np.inf  # s
    X_WE: RigidTransform = field(default_factory=RigidTransform)
    valid: bool = False
    residual: float = 0.0  # m, the camera's own estimate of its error


@dataclass(frozen=True, slots=True)
class ImageSample:
    """Whole images of all cameras, taken at once."""

    time: float = -np.inf  # s, of the exposure
    images: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 0, 3), np.uint8))  # (n, h, w, 3)

    def __deepcopy__(self, memo: dict[int, Any]) -> "ImageSample":
        """Itself, for nothing in it changes: Drake copies states, and images are large."""
        return self


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody in the cell, or something that was not there before."""

    number: int  # the same from sample to sample
    points: np.ndarray  # middles of the cubes that it fills in the world in m, (k, 3)
    reach: float  # m, of the body beyond these points
    velocity: np.ndarray  # of its middle in the world in m/s, (3,)


@dataclass(frozen=True, slots=True)
class PersonSample:
    """Who is in the cell. ``time`` is the exposure, not the arrival."""

    time: float = -np.inf  # s
    trusted: bool = False  # whether nobody else can be there
    people: tuple[Person, ...] = ()

    def __deepcopy__(self, memo: dict[int, Any]) -> "PersonSample":
        """Itself, for nothing in it changes."""
        return self
