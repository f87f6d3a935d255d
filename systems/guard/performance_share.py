"""How fast a path may be run by a controller that says how much of its performance that takes."""

import math

_LEAST_RATE = 0.2  # of the path time, below which the full speed is not told from what is needed now
_LEAST = 0.1  # of the speed: a robot that stands would never say that it could go on
_RISE = 0.1  # 1/s
_GRADES = 20  # of the share: one that changes with every message would be many changes of the path time


class PerformanceShare:
    """Lowers the share of the speed as soon as more than all is needed, and raises it slowly again."""

    def __init__(self) -> None:
        """Full speed."""
        self._share = 1.0

    def after(self, utilization: float, rate: float, passed: float) -> float:
        """The share of the planned speed from now on.

        Args:
            utilization: of the robot's performance, 1 for all of it; more is not reached.
            rate: of the path time, at which that was needed.
            passed: s since the last time.
        """
        if utilization > 1.0 and rate > _LEAST_RATE:
            self._share = max(_LEAST, min(self._share, rate / utilization))
        else:
            self._share = min(1.0, self._share + _RISE * passed)
        return math.floor(_GRADES * self._share + 1e-9) / _GRADES
