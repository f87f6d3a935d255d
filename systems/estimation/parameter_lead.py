"""Leads the parameters that a robot is commanded with to those that are estimated, without a jerk."""

from types import SimpleNamespace

import numpy as np

from systems.estimation import kernels
from systems.estimation.memory import Layout

_ARM = 0.25  # m, by which an angle counts as a way of the tip


class ParameterLead:
    """A critically damped filter whose speed depends on how far the tip has to be moved.

    Its natural frequency is the smaller of a largest one and sqrt(a / s), with the way s that the parameters
    move the tip and the largest acceleration a: a way of any size begins with at most that acceleration.
    The step in time is implicit, so that it is stable at any frequency.
    """

    def __init__(self, size: int, frequency: float = 30.0, acceleration: float = 0.5) -> None:
        """Sets the limits.

        Args:
            size: how many parameters.
            frequency: the largest, in rad/s.
            acceleration: of the tip, the largest, in m/s^2.
        """
        self._frequency, self._acceleration = frequency, acceleration
        self.layout = Layout(x=(size,), rate=(size,), unrest=(1,))

    def step(self, memory: SimpleNamespace, target: np.ndarray, columns: np.ndarray, period: float) -> None:
        """Goes one step.

        Args:
            memory: of the layout: parameters, their rates, and the acceleration of the tip in m/s^2.
            target: the estimate.
            columns: how the tip moves with the first parameters, (6, g); zero if that is not known yet.
            period: in s.
        """
        limits = self._frequency, self._acceleration
        memory.unrest[0] = kernels.plan.lead(memory.x, memory.rate, target, columns, limits, _ARM, period)
