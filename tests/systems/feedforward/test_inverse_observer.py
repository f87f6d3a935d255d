"""The inverse disturbance observer: its filter, its bandwidth by the zeros, and an inverse that is wrong."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, ConstantVectorSource, Gain, LinearSystem, LogVectorOutput

from experiments.zeros.linear_arm import LinearArm, observed_error
from robots.dynamics.transmission_zeros import Zeros
from systems.feedforward.inverse_observer import InverseObserver

HERTZ = 5.0


def test_q_passes_what_is_slow_and_a_root_of_a_half_at_the_bandwidth():
    above, below = InverseObserver(HERTZ).gain()

    def passed(hertz: float) -> float:
        gain = above(2j * np.pi * hertz) / below(2j * np.pi * hertz)
        return abs(gain / (1.0 + gain))

    assert passed(0.01) == pytest.approx(1.0, abs=1e-4)
    assert passed(HERTZ) == pytest.approx(np.sqrt(0.5), rel=1e-6)
    assert passed(100.0 * HERTZ) == pytest.approx(0.0, abs=1e-6)


def test_the_system_is_the_filter_in_every_channel():
    observer = InverseObserver(HERTZ)
    system = observer.system(2)
    s = 2j * np.pi * 3.0
    found = system.C() @ np.linalg.solve(s * np.eye(8) - system.A(), system.B()) + system.D()
    above, below = observer.gain()
    np.testing.assert_allclose(found, above(s) / below(s) * np.eye(2), rtol=1e-9)


def test_around_an_inverse_that_is_a_fifth_wrong_the_model_ends_where_it_shall():
    """The model is a lag, the inverse only a gain; without the observer a fifth of the step is missing."""
    builder = DiagramBuilder()
    wanted = builder.AddSystem(ConstantVectorSource(np.array([1.0])))
    asked = builder.AddSystem(Adder(2, 1))
    inverse = builder.AddSystem(Gain(0.8, 1))
    lag = np.array([[50.0]])
    model = builder.AddSystem(LinearSystem(-lag, lag, np.eye(1), np.zeros((1, 1))))
    error = builder.AddSystem(Adder(2, 1))
    negative = builder.AddSystem(Gain(-1.0, 1))
    observer = builder.AddSystem(InverseObserver(HERTZ).system())
    builder.Connect(wanted.get_output_port(), asked.get_input_port(0))
    builder.Connect(observer.get_output_port(), asked.get_input_port(1))
    builder.Connect(asked.get_output_port(), inverse.get_input_port())
    builder.Connect(inverse.get_output_port(), model.get_input_port())
    builder.Connect(model.get_output_port(), negative.get_input_port())
    builder.Connect(wanted.get_output_port(), error.get_input_port(0))
    builder.Connect(negative.get_output_port(), error.get_input_port(1))
    builder.Connect(error.get_output_port(), observer.get_input_port())
    log = LogVectorOutput(model.get_output_port(), builder, 0.01)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.5)
    assert log.FindLog(simulator.get_context()).data()[0, -1] == pytest.approx(1.0, abs=1e-4)


def test_the_bandwidth_is_below_the_slowest_zero_in_the_right_half_plane():
    zeros = LinearArm().zeros
    highest = InverseObserver.highest_bandwidth(zeros)
    assert highest == pytest.approx(305.5786 / (2.0 * np.pi), rel=1e-6)
    assert InverseObserver.beside(zeros).bandwidth == pytest.approx(0.6 * highest)
    assert InverseObserver.beside(zeros, 30.0).bandwidth == 30.0
    with pytest.raises(ValueError, match=r"must be below 48\.6 Hz, the slowest zero .* got 50 Hz"):
        InverseObserver.beside(zeros, 50.0)


def test_at_30_hz_half_the_error_of_the_approximate_inverse_is_left_and_at_50_hz_it_is_unstable():
    arm = LinearArm()
    plain, observed = observed_error(arm, None), observed_error(arm, InverseObserver(30.0))
    assert plain is not None
    assert observed is not None
    assert np.abs(observed).max() == pytest.approx(0.48 * np.abs(plain).max(), rel=0.05)
    assert observed_error(arm, InverseObserver(50.0)) is None


def test_a_point_with_a_stable_inverse_is_refused_nothing_but_needs_a_bandwidth():
    zeros = LinearArm(x_l=0.0).zeros
    assert zeros.is_minimum_phase
    assert InverseObserver.beside(zeros, 200.0).bandwidth == 200.0
    with pytest.raises(ValueError, match="no zero in the right half-plane by which to choose"):
        InverseObserver.beside(zeros)


@pytest.mark.parametrize(
    ("values", "message"),
    [((0.0, 4), "bandwidth must be positive, got 0"), ((5.0, 0), "order must be between 1 and 8, got 0")],
)
def test_impossible_numbers_are_refused(values: tuple[float, int], message: str):
    with pytest.raises(ValueError, match=message):
        InverseObserver(*values)


def test_without_zeros_there_is_no_limit():
    assert InverseObserver.highest_bandwidth(Zeros(np.zeros(0), 4)) == np.inf
