"""Timings that a planned one is measured against, and all of them at rest before and after."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from robots.planning.joint_path import PathError
from robots.planning.limit_use import use_of
from robots.planning.limits import MotionLimits
from robots.planning.path_dynamics import ORDERS, PathDynamics
from systems.reference.timing import SineSquaredProfile

_SAMPLES = 200
_ACCURATE = 2e-4  # of a duration
_SHORTEST, _LONGEST = 0.02, 60.0  # s
_STEP = 1e-5  # of the duration: differences of accelerations


class Timing(Protocol):
    """s(t) along a path, from rest to rest."""

    @property
    def duration(self) -> float:
        """In s."""
        ...

    @property
    def times(self) -> np.ndarray:
        """Times in s that resolve the motion, shape (n,)."""
        ...

    def rates(self, t: np.ndarray) -> np.ndarray:
        """s and four derivatives by time, shape (5, n)."""
        ...


class EvenTiming:
    """A path whose parameter is the share of the time: rest at both ends is a matter of the path itself."""

    def __init__(self, duration: float) -> None:
        """Takes so many s."""
        self.duration = duration

    @property
    def times(self) -> np.ndarray:
        """Times in s that resolve the motion."""
        return np.linspace(0.0, self.duration, _SAMPLES)

    def rates(self, t: np.ndarray) -> np.ndarray:
        """s and four derivatives, shape (5, n)."""
        rates = np.zeros((ORDERS, len(t)))
        rates[0], rates[1] = np.clip(t / self.duration, 0.0, 1.0), 1.0 / self.duration
        return rates


class SineSquared:
    """The present timing: two sin^2 humps of acceleration, Probst (2024), eq. (5.2)."""

    def __init__(self, duration: float) -> None:
        """Takes so many s."""
        self.duration = duration
        self._profile = SineSquaredProfile.lasting(duration)

    @property
    def times(self) -> np.ndarray:
        """Times in s that resolve the motion."""
        return np.linspace(0.0, self.duration, _SAMPLES)

    def rates(self, t: np.ndarray) -> np.ndarray:
        """s and four derivatives, the last two by differences; shape (5, n)."""
        h = _STEP * self.duration
        before, _, after = (self._profile.at_times(t + step)[2] for step in (-h, 0.0, h))
        s, rate, acceleration = self._profile.at_times(t)
        third, fourth = (after - before) / (2.0 * h), (after - 2.0 * acceleration + before) / h**2
        return np.array([s, rate, acceleration, third, fourth])


def quickest(make: Callable[[float], Timing], dynamics: PathDynamics, limits: MotionLimits) -> Timing:
    """Of timings that differ in their duration the quickest one within the limits.

    Raises:
        PathError: if there is none of up to a minute.
    """
    low, high = _SHORTEST, _LONGEST

    def keeps(duration: float) -> bool:
        timing = make(duration)
        demand = dynamics.demand(timing.rates(timing.times))
        return use_of(demand, limits, timing.times).largest <= 1.0

    if not keeps(high):
        raise PathError(f"the limits admit no motion along the path, not even one of {_LONGEST:g} s")
    while high / low > 1.0 + _ACCURATE:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if keeps(middle) else (middle, high)
    return make(high)


def held(timing: Timing, t: np.ndarray) -> np.ndarray:
    """`Timing.rates` at any time in s: at rest before and after, shape (5, n)."""
    rates = timing.rates(np.clip(t, 0.0, timing.duration))
    moving = (t > 0.0) & (t < timing.duration)
    return np.vstack([rates[:1], np.where(moving, rates[1:ORDERS], 0.0)])
