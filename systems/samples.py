"""Stamped measurements as they travel on abstract ports."""

from dataclasses import dataclass, field

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
