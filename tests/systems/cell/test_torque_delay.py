"""The way of a torque: how late it comes."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from systems.cell.torque_delay import TorqueDelay
from tests.systems.rigs import PERIOD, VectorSignal

SLOPES = np.arange(1.0, 7.0)  # N m / s


@pytest.mark.parametrize("delay", [0.004, 0.005, 0.006, 0.008, 0.0115, 0.140])
def test_a_torque_comes_a_delay_after_its_issue_and_is_held_for_a_period(delay: float):
    """Ramps: what is held since a tick is what they were a delay before it.

    What can be read at a tick was issued at the one before.
    """
    builder = DiagramBuilder()
    ramp = builder.AddSystem(VectorSignal(lambda time: SLOPES * (time - PERIOD)))
    late = builder.AddSystem(TorqueDelay(PERIOD, delay))
    builder.Connect(ramp.get_output_port(), late.get_input_port())
    simulator = Simulator(builder.Build())
    context = late.GetMyContextFromRoot(simulator.get_context())
    for time in 0.2 + np.arange(0.5, 30.0, 0.25) * PERIOD:
        simulator.AdvanceTo(time)
        tick = np.floor(time / PERIOD + 1e-9) * PERIOD
        if time - tick > 1e-6:  # at a tick itself the next one is not there yet
            np.testing.assert_allclose(
                late.get_output_port().Eval(context), SLOPES * (tick - delay), atol=1e-12
            )
