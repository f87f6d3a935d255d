"""What makes an elastic arm ring after a motion: the part of it that is as quick as the arm's own modes.

A feedforward makes up for what gears and structure yield as if they did so at once. What it leaves goes with
higher derivatives of the motion, and only what of them lies near a mode stays when the motion is over: the
Fourier transform of the fifth at the modes' frequencies. What rings early has died away by then, the more the
quicker it swings, so that a motion has to be calm near its end most of all. The transform is linear in the
coefficients of the spline, so that a planner can keep it small without being slow, as shaping filters do
(Singer and Seering, 1990), but within all limits.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from robots.description.model import RobotModel
from robots.dynamics.modes import ModalAnalysis
from robots.planning.joint_path import Curve
from robots.planning.time_spline import DEGREE, knots

_BELOW = 0.85  # of the lowest mode: springs are known to some 30 %
_HIGHEST = 125.0  # Hz: half the rate of drives of 4 ms; what they are told has nothing above
_PLACES = np.array([0.5, 1.0])  # on the path
_PER_PERIOD = 6  # frequencies in the reciprocal of the duration
_ORDER = 5  # of the derivative: with the fourth or sixth KR 16 rings more in the same time
_NODES = 8  # of the Gauss-Legendre rule in every interval of the spline


class Band(NamedTuple):
    """The frequencies at which an arm rings."""

    low: float  # Hz
    high: float  # Hz
    damping: float = 0.0  # ratio at the lowest; dampers beside springs make it grow with the frequency


def ringing_band(robot: RobotModel, payload: float, path: Curve) -> Band:
    """The frequencies at which the arm rings at the end of a path.

    Args:
        robot: as the planner knows it.
        payload: mass at the flange in kg.
        path: q(s) in rad.

    Raises:
        ValueError: if the arm is too soft to carry itself.
    """
    analysis = ModalAnalysis(robot, "structure", payload)
    modes = [analysis.at(q) for q in path.at(_PLACES)]
    lowest = min(float(each.frequency_hz[0]) for each in modes)
    damping = min(float(each.damping_ratio[0] / each.frequency_hz[0]) for each in modes)
    low = _BELOW * lowest
    return Band(low, max(_HIGHEST, 2.0 * lowest), damping * low)


def ringing_rows(count: int, duration: float, band: Band) -> np.ndarray:
    """The spectrum of the fifth derivative as a function of a spline's coefficients, shape (2 k, count).

    The sum of squares of what the rows give is the integral of its square over the band, with time in
    durations: real parts first, then imaginary ones. Each frequency counts as it has died away by the end.

    Args:
        count: of the coefficients.
        duration: s.
        band: frequencies at which the arm rings.
    """
    low, high = band.low * duration, band.high * duration  # periods in a motion
    per_motion = np.linspace(low, high, max(2, round(_PER_PERIOD * (high - low))))
    breaks = knots(count)[DEGREE:-DEGREE]
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    half = 0.5 * np.diff(breaks)
    x = (breaks[:-1, None] + half[:, None] * (node + 1.0)).ravel()
    w = (half[:, None] * weight).ravel()
    basis = BSpline(knots(count), np.eye(count), DEGREE).derivative(_ORDER)(x)
    damping = band.damping * per_motion / low
    turn = 2.0 * np.pi * per_motion  # rad in a motion
    waves = np.exp(np.outer(turn * (1j - damping), 1.0 - x))
    spectrum = (waves * w) @ basis * np.sqrt((high - low) / len(per_motion))
    return np.vstack([spectrum.real, spectrum.imag])
