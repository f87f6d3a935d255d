"""What is recorded of a robot in motion: its motors, and sensors on its bodies, on one time axis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

KINDS = ("gyro", "accelerometer")
GAMMA, BETA = 0.5, 0.25  # of the steps of Newmark (1959) in which motions are integrated


@dataclass(frozen=True)
class SensorPlace:
    """A sensor with three axes on a body of the robot, as its data sheet and the mounting say."""

    name: str
    kind: str  # of `KINDS`
    body: str  # of the plant
    position: np.ndarray  # m in the frame of the body, shape (3,)
    rotation: np.ndarray  # R_BS, its axes in that frame, shape (3, 3)
    bandwidth: float  # Hz, of a low-pass of first order
    sigma: float  # rad/s or m/s^2, noise of one sample


@dataclass(frozen=True)
class MotionCase:
    """One motion from rest, sampled evenly; a "case" of Reiner (2010), section 4.2."""

    name: str
    period: float  # s
    theta: np.ndarray  # (n, 6) rad, motors on the side of the links
    rate: np.ndarray  # (n, 6) rad/s
    readings: np.ndarray  # (n, sensors, 3) rad/s or m/s^2

    @property
    def times(self) -> np.ndarray:
        """In s from its beginning, shape (n,)."""
        return self.period * np.arange(len(self.theta))

    @property
    def acceleration(self) -> np.ndarray:
        """Of the motors in rad/s^2, shape (n, 6): the derivative of a spline through their velocities.

        A central difference, (4.2) of the source, would lose a hundredth at 40 Hz and 1 ms.
        """
        return CubicSpline(self.times, self.rate).derivative()(self.times)


def longest(cases: Sequence[MotionCase]) -> int:
    """The most samples that one of the cases has."""
    return max(len(case.theta) for case in cases)
