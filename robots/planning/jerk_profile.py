"""Jerk-limited motion along a path: seven segments of constant jerk, as controllers have it.

It is what a planned motion is measured against: of all such profiles the quickest one that keeps the limits.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import ruckig
from scipy.optimize import minimize_scalar

from robots.planning.limit_use import use_of
from robots.planning.limits import MotionLimits
from robots.planning.path_dynamics import ORDERS, PathDynamics

_SAMPLES = 160
_RATIOS = np.geomspace(8.0, 200.0, 6)  # jerk over acceleration, in 1/s
_ACCURATE = 5e-4  # of the acceleration
_SLOWEST = 1e-4  # acceleration over the largest speed in 1/s, below which no slower one is tried
_TOP = 0.99  # of the largest speed: where gears unwind, motors turn a little quicker than links


@dataclass(frozen=True)
class JerkProfile:
    """s(t) from 0 to 1, rest to rest, within constant limits of ds/dt and its two derivatives.

    Attributes:
        speed: 1/s.
        acceleration: 1/s^2.
        jerk: 1/s^3.
    """

    speed: float
    acceleration: float
    jerk: float

    @cached_property
    def trajectory(self) -> ruckig.Trajectory:
        """As ruckig plans it."""
        wanted = ruckig.InputParameter(1)
        wanted.current_position, wanted.target_position = [0.0], [1.0]
        wanted.max_velocity = [self.speed]
        wanted.max_acceleration, wanted.max_jerk = [self.acceleration], [self.jerk]
        trajectory = ruckig.Trajectory(1)
        ruckig.Ruckig(1).calculate(wanted, trajectory)
        return trajectory

    @property
    def duration(self) -> float:
        """In s."""
        return float(self.trajectory.duration)

    @property
    def times(self) -> np.ndarray:
        """Times in s that resolve the motion, among them those at which the jerk jumps."""
        ends = np.cumsum(self.trajectory.profiles[0][0].t)
        return np.unique(np.append(np.linspace(0.0, self.duration, _SAMPLES), ends.clip(0.0, self.duration)))

    def rates(self, t: np.ndarray) -> np.ndarray:
        """s and four derivatives at t in s, shape (5, n); the jerk jumps, its rate counts as zero."""
        profile = self.trajectory.profiles[0][0]
        inside = np.clip(t, 0.0, self.duration)
        ends = np.cumsum(profile.t)
        i = np.minimum(np.searchsorted(ends, inside), len(ends) - 1)
        j, x, v, a = (np.array(each)[i] for each in (profile.j, profile.p, profile.v, profile.a))
        h = inside - np.append(0.0, ends)[i]
        s = x + h * (v + h * (a / 2.0 + h * j / 6.0))
        return np.array([s, v + h * (a + h * j / 2.0), a + h * j, j, np.zeros_like(h)])


def best_jerk_profile(dynamics: PathDynamics, limits: MotionLimits) -> JerkProfile:
    """The quickest of all jerk-limited profiles along a path within the limits.

    For each ratio of jerk to acceleration the largest acceleration is found by halving, and of all ratios
    the best.
    """
    s = np.linspace(0.0, 1.0, _SAMPLES)
    slope = np.abs(dynamics.path.at(s, 1))
    evenly = np.vstack([s, np.ones_like(s), np.zeros((ORDERS - 2, len(s)))])
    of_tool = dynamics.demand(evenly).tool_speed / limits.tool_speed
    top = _TOP / float(max((slope / limits.speed).max(), of_tool.max()))

    def keeps(profile: JerkProfile) -> bool:
        demand = dynamics.demand(profile.rates(profile.times))
        return use_of(demand, limits, profile.times).largest <= 1.0

    def fastest(ratio: float) -> JerkProfile:
        low, high = 0.3 * top, 100.0 * top
        while not keeps(JerkProfile(top, low, ratio * low)) and low > _SLOWEST * top:
            low, high = 0.1 * low, low
        while high / low > 1.0 + _ACCURATE:
            middle = float(np.sqrt(low * high))
            if keeps(JerkProfile(top, middle, ratio * middle)):
                low = middle
            else:
                high = middle
        return JerkProfile(top, low, ratio * low)

    durations = [fastest(ratio).duration for ratio in _RATIOS]
    i = int(np.argmin(durations))
    bounds = np.log(_RATIOS[[max(i - 1, 0), min(i + 1, len(_RATIOS) - 1)]])
    found = minimize_scalar(
        lambda x: fastest(float(np.exp(x))).duration,
        bounds=tuple(bounds),
        method="bounded",
        options={"xatol": 0.05},
    )
    best = fastest(float(np.exp(found.x)))
    return best if best.duration <= durations[i] else fastest(float(_RATIOS[i]))
