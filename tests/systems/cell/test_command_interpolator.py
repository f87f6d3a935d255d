"""The fine interpolation of commands: exact for parabolas, dead beat, never late, for every delay."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LinearSystem, ZeroOrderHold

from systems.cell.command_interpolator import CommandInterpolator
from tests.systems.rigs import PERIOD, VectorSignal

DELAYS = [0.004, 0.008, 0.010, 0.012, 0.140]  # s
ROUNDING = 1e-10  # rad, of dead-beat gains of 6e4 1/s^2 over 4 ms


def setpoints(
    times: np.ndarray, p: Callable, v: Callable, delay: float, tracks_position: bool = True
) -> np.ndarray:
    """Positions of axis 1 under commands (p(t), v(t)) issued at every tick t; starts at rest at zero."""
    builder = DiagramBuilder()
    interpolator = builder.AddSystem(CommandInterpolator(PERIOD, delay, tracks_position))
    for name, function in (("position_command", p), ("velocity_command", v)):
        signal = builder.AddSystem(VectorSignal(lambda time, f=function: np.full(6, f(time), dtype=float)))
        hold = builder.AddSystem(ZeroOrderHold(PERIOD, 6))  # a command stands from its tick to the next
        builder.Connect(signal.get_output_port(), hold.get_input_port())
        builder.Connect(hold.get_output_port(), interpolator.GetInputPort(name))
    zero, one = np.zeros((6, 6)), np.eye(6)
    A, B = np.block([[zero, one], [zero, zero]]), np.vstack([zero, one])
    point = builder.AddSystem(LinearSystem(A, B, np.eye(12), np.zeros((12, 6))))
    builder.Connect(interpolator.GetOutputPort("acceleration"), point.get_input_port())
    builder.Connect(point.get_output_port(), interpolator.GetInputPort("setpoint"))
    simulator = Simulator(builder.Build())
    simulator.get_mutable_integrator().set_maximum_step_size(1e-3)
    context = simulator.get_mutable_context()
    interpolator.set_at_rest(context, np.zeros(6))
    found = []
    for time in times:
        simulator.AdvanceTo(time)
        found.append(point.GetMyContextFromRoot(context).get_continuous_state_vector().CopyToVector()[0])
    return np.array(found)


def after_the_start(delay: float) -> np.ndarray:
    """Every millisecond, from when the running motion has arrived and two periods have passed."""
    start = np.ceil(delay / PERIOD) * PERIOD + 4 * PERIOD
    return start + np.arange(30) * 1e-3


@pytest.mark.parametrize("delay", DELAYS)
@settings(max_examples=20)
@given(a=st.floats(-1.0, 1.0), b=st.floats(-5.0, 5.0), c=st.floats(-50.0, 50.0))
def test_parabolas_are_followed_exactly_after_the_delay(delay: float, a: float, b: float, c: float):
    """Between the ticks too, whether the delay is a multiple of the period or not."""
    times = after_the_start(delay)
    found = setpoints(times, lambda t: a + b * t + c * t * t, lambda t: b + 2.0 * c * t, delay)
    t = times - delay
    np.testing.assert_allclose(found, a + b * t + c * t * t, atol=ROUNDING)


@pytest.mark.parametrize("delay", DELAYS)
def test_a_motion_of_constant_velocity_is_not_late(delay: float):
    """A position held from command to command would be half a period late: 2 mrad at 1 rad/s."""
    times = after_the_start(delay)
    found = setpoints(times, lambda t: t, lambda t: 1.0, delay)
    np.testing.assert_allclose(found, times - delay, atol=ROUNDING)


@pytest.mark.parametrize("delay", [0.008, 0.012, 0.140])
def test_a_constant_jerk_leaves_a_24th_of_jerk_times_period_cubed(delay: float):
    """At the ticks, and a fifth more between them, where the command is known at the instant it is for."""
    jerk, times = 100.0, delay + 0.04 + np.arange(40) * PERIOD / 4.0
    found = setpoints(times, lambda t: jerk * t**3 / 6.0, lambda t: jerk * t**2 / 2.0, delay)
    error = (found - jerk * (times - delay) ** 3 / 6.0) / (jerk * PERIOD**3 / 24.0)
    np.testing.assert_allclose(error[::4], 1.0, rtol=1e-6)
    assert 1.0 < error.max() < 1.2


@pytest.mark.parametrize("delay", [0.004, 0.008, 0.012])
def test_a_step_is_reached_exactly_two_periods_after_it_arrives(delay: float):
    """Dead beat. The first tick to read a step is a period after its issue, or the delay less a period."""
    issue = 5 * PERIOD
    read = issue + max(PERIOD, delay - PERIOD)
    times = read + PERIOD * np.arange(-2, 8)
    found = setpoints(times, lambda t: 1.0 if t >= issue - 1e-9 else 0.0, lambda t: 0.0, delay)
    np.testing.assert_allclose(found[:3], 0.0, atol=ROUNDING)
    assert found[3] != pytest.approx(1.0)
    np.testing.assert_allclose(found[4:], 1.0, atol=ROUNDING)


@pytest.mark.parametrize("delay", DELAYS)
def test_a_velocity_controlled_setpoint_follows_the_integral_of_the_velocity(delay: float):
    """Whatever the position command says; under constant acceleration it is late by the delay and no more."""
    times = after_the_start(delay)
    found = setpoints(times, lambda t: 17.0, lambda t: 2.0 * t, delay, tracks_position=False)
    speed = np.gradient(found, times)[1:-1]
    np.testing.assert_allclose(speed, 2.0 * (times - delay)[1:-1], atol=1e-6)


@pytest.mark.parametrize(
    ("period", "delay", "message"),
    [
        (0.0, 0.004, "drive: period must be positive, got 0.0 s"),
        (
            0.004,
            0.003,
            r"station.drive.command_delay \+ station.drive.dead_time must be at least station.period=0.004 s"
            ".* they are 0.003 s",
        ),
    ],
)
def test_refuses_impossible_times(period: float, delay: float, message: str):
    with pytest.raises(ValueError, match=message):
        CommandInterpolator(period, delay)
