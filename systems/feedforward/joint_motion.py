"""What goes into an inverse model and what comes out, in joint coordinates; shape (6,) each."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class JointReference:
    """Where the links are to be."""

    position: np.ndarray  # rad
    velocity: np.ndarray  # rad/s
    acceleration: np.ndarray  # rad/s^2


@dataclass(frozen=True)
class Standing:
    """A robot at rest, as encoders and a camera show it."""

    theta: np.ndarray  # rad, (6,)
    p_WE: np.ndarray  # m, tip in the world, (3,)


@dataclass(frozen=True)
class Drive:
    """What motors shall do so that the links follow, and what the model remembers of it."""

    deflection: np.ndarray  # rad, by which the motors are behind the reference
    deflection_rate: np.ndarray  # rad/s
    torque: np.ndarray  # N m, joint side, all that the motors give
    memory: np.ndarray


@dataclass(frozen=True)
class Answer:
    """What motors are told, what of it a law's commands for the links lack, and what the model remembers."""

    position: np.ndarray  # rad
    velocity: np.ndarray  # rad/s
    position_offset: np.ndarray  # rad
    velocity_offset: np.ndarray  # rad/s
    torque: np.ndarray  # N m, joint side, beyond the drives' gravity compensation
    memory: np.ndarray
