"""The way of a torque feedforward: as late as the positions that it belongs to."""

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import DiscreteTimeDelay, LinearSystem

from robots.description.model import NUM_JOINTS


class TorqueDelay(Diagram):
    """Holds torques for a period and gives them a delay after their issue.

    Between two torques, which are a period apart, is what lies on the straight line between them.

    Ports:
        in  ``torque``   vector 6 in N m
        out ``delayed``  vector 6 in N m
    """

    def __init__(self, period: float, delay: float) -> None:
        """Splits the delay into whole periods and a rest.

        Args:
            period: time between torques in s.
            delay: in s, at least a period: that is how long it takes to read the input.
        """
        super().__init__()
        periods = int(np.floor(delay / period + 1e-9))
        rest = delay / period - periods
        builder = DiagramBuilder()
        transit = builder.AddNamedSystem("transit", DiscreteTimeDelay(period, periods - 1, NUM_JOINTS))
        delayed = transit.get_output_port()
        if rest > 1e-9:
            between = builder.AddNamedSystem("between", _between(period, rest))
            builder.Connect(delayed, between.get_input_port())
            delayed = between.get_output_port()
        builder.ExportInput(transit.get_input_port(), "torque")
        builder.ExportOutput(delayed, "delayed")
        builder.BuildInto(self)


def _between(period: float, rest: float) -> LinearSystem:
    """On the line from the input to what it was a period ago, the share ``rest`` of the way."""
    zero, one = np.zeros((NUM_JOINTS, NUM_JOINTS)), np.eye(NUM_JOINTS)
    return LinearSystem(zero, one, rest * one, (1.0 - rest) * one, period)
