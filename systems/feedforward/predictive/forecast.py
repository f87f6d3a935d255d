"""What the predictive correction knows at a tick: the drives, and the next ticks of six motors under them."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Cascade:
    """What a drive gives per inertia that it is tuned for: accelerations for an error."""

    proportional: float  # 1/s^2
    derivative: float  # 1/s
    integral: float  # 1/s^3


@dataclass(frozen=True)
class Forecast:
    """The next n ticks of six motors; torques are divided by the inertia that the drives are tuned for.

    An error is the command less the motor.
    """

    error: np.ndarray  # rad now, (6,)
    error_rate: np.ndarray  # rad/s now, (6,)
    integral: np.ndarray  # rad/s^2, what the integrals of the drives give now, (6,)
    inertia: np.ndarray  # share of the one that drives are tuned for, (6,)
    friction_slope: np.ndarray  # 1/s, by which friction damps deviations, at each tick, (n, 6)
    disturbance: np.ndarray  # rad/s^2, what the motors need beyond the feedforward, (n, 6)
    lower: np.ndarray  # rad/s^2, of the correction; as the upper one where it is under way already, (n, 6)
    upper: np.ndarray  # rad/s^2, (n, 6)
