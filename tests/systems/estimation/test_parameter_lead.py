"""The lead: bounded, smooth, and there in the end."""

import numpy as np
import pytest

from systems.estimation.parameter_lead import ParameterLead


@pytest.mark.parametrize("way", [1e-4, 5e-3, 0.05])
def test_the_tip_follows_an_estimate_that_jumps_with_bounded_acceleration(way):
    period, lead = 1e-3, ParameterLead(1, frequency=30.0, acceleration=0.5)
    memory = lead.layout.view(np.zeros(lead.layout.size))
    columns = np.zeros((6, 1))
    columns[3] = 1.0
    positions = []
    for _ in range(4000):
        lead.step(memory, np.array([way]), columns, period)
        positions.append(memory.x[0])
    rates = np.diff(positions) / period
    assert np.abs(np.diff(rates)).max() / period < 0.5 + 1e-9
    assert np.diff(positions).min() > -1e-12  # critically damped: it does not overshoot
    assert positions[-1] == pytest.approx(way, rel=1e-3)
