"""Tells the guard of the camera where a law does not."""

import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues

from systems.sampled_system import SampledSystem
from systems.samples import PoseSample


class SampleWatch(SampledSystem):
    """Notes when the newest valid sample came.

    Ports:
        in  ``pose_sample``  PoseSample
        out ``measurement``  vector 3, as a law's: when the newest valid sample arrived (s), how many were
                             refused (none), when it was exposed (s)
    """

    def __init__(self, period: float) -> None:
        """Takes the tick in s."""
        super().__init__()
        self._camera = self.DeclareAbstractInputPort("pose_sample", Value(PoseSample()))
        state = self.DeclareDiscreteState(np.array([-math.inf, 0.0, -math.inf]))
        self.DeclareStateOutputPort("measurement", state)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._look)

    def _look(self, context: Context, discrete_state: DiscreteValues) -> None:
        sample: PoseSample = self._camera.Eval(context)
        if sample.valid and sample.time > context.get_discrete_state_vector().value()[2]:
            discrete_state.set_value(0, np.array([context.get_time(), 0.0, sample.time]))
