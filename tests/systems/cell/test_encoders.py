"""Encoders: steps, differences for a velocity, and an error once a turn that the drives follow."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LinearSystem

from robots.description.model import load_robot
from systems.cell.encoders import EncoderConfig, Encoders, SteppedReading, erring_encoders

ROBOT = load_robot("irb1200")
PERIOD = 4e-3


@pytest.mark.parametrize(("side", "turns"), [("joint", np.ones(6)), ("motor", np.abs(ROBOT.gear_ratio))])
def test_a_turn_of_a_disc_has_two_to_the_bits_steps(side: str, turns: np.ndarray):
    encoders = Encoders(ROBOT, EncoderConfig(side=side, bits=17))
    theta = np.random.default_rng(0).uniform(-2.0, 2.0, (1000, 6))
    reading = encoders.rounded(theta)
    step = 2.0 * np.pi / 2**17 / turns
    assert np.abs(reading - theta).max(axis=0) == pytest.approx(0.5 * step, rel=0.02)
    np.testing.assert_allclose(reading / step, np.round(reading / step), atol=1e-6)


def test_exact_encoders_say_what_is():
    encoders = Encoders(ROBOT, EncoderConfig())
    theta = np.linspace(-1.0, 1.0, 6)
    assert np.array_equal(encoders.rounded(encoders.angle(theta)), theta)
    assert (encoders.has_steps, encoders.have_errors) == (False, False)


def turning(system, rate: float, until: float) -> tuple[np.ndarray, np.ndarray]:
    """The motor state and what a system says of it, after all joints have turned at a rate in rad/s."""
    A = np.block([[np.zeros((6, 6)), np.eye(6)], [np.zeros((6, 12))]])
    builder = DiagramBuilder()
    joints = builder.AddSystem(LinearSystem(A, np.zeros((12, 0)), np.eye(12), np.zeros((12, 0))))
    builder.AddSystem(system)
    builder.Connect(joints.get_output_port(), system.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    joints.GetMyMutableContextFromRoot(context).SetContinuousState(np.repeat([0.3, rate], 6))
    simulator.AdvanceTo(until)
    state = joints.get_output_port().Eval(joints.GetMyContextFromRoot(context))
    return state, system.get_output_port().Eval(system.GetMyContextFromRoot(context))


def test_the_velocity_of_steps_is_the_difference_of_two_readings():
    encoders = Encoders(ROBOT, EncoderConfig(bits=14))
    state, said = turning(SteppedReading(encoders, PERIOD), 0.5, 25 * PERIOD)
    now, before = (encoders.rounded(state[:6] - k * 0.5 * PERIOD) for k in (0, 1))
    np.testing.assert_allclose(said[:6], now, atol=1e-12)
    np.testing.assert_allclose(said[6:], (now - before) / PERIOD, atol=1e-6)


def test_an_eccentric_disc_errs_once_a_turn_and_its_velocity_is_the_derivative():
    config = EncoderConfig(side="motor", eccentricity_deg=0.5, phase_deg=np.linspace(0.0, 150.0, 6))
    encoders = Encoders(ROBOT, config)
    state, said = turning(erring_encoders(encoders), 0.5, 0.1)
    np.testing.assert_allclose(said[:6], encoders.angle(state[:6]), atol=1e-14)
    h = 1e-6
    slope = (encoders.angle(state[:6] + h) - encoders.angle(state[:6] - h)) / (2.0 * h)
    np.testing.assert_allclose(said[6:], 0.5 * slope, rtol=1e-6)
    error = encoders.angle(np.linspace(0.0, 2.0 * np.pi, 2000)[:, None] / encoders.turns) - (
        np.linspace(0.0, 2.0 * np.pi, 2000)[:, None] / encoders.turns
    )
    assert np.rad2deg(np.abs(error).max(axis=0) * encoders.turns) == pytest.approx(0.5, rel=1e-3)


def test_scales_and_coupled_wrists_hide_a_share_of_the_motion():
    """A joint turns by what its encoder says, by a share of that, and by what joints before it turn it."""
    config = EncoderConfig(
        scale_ppm=np.linspace(100.0, 600.0, 6), coupling_ppm=np.array([2000.0, 3000.0, 4000.0])
    )
    encoders, said = Encoders(ROBOT, config), np.array([0.3, -0.4, 0.5, 1.1, -0.9, 2.0])
    true = said * (1.0 + 1e-6 * config.scale_ppm)
    true += [0.0, 0.0, 0.0, 0.0, 2e-3 * said[3], 3e-3 * said[3] + 4e-3 * said[4]]
    np.testing.assert_allclose(encoders.true_position(said), true, atol=1e-15)
    np.testing.assert_allclose(encoders.angle(true), said, atol=1e-15)
    state, reading = turning(erring_encoders(encoders), 0.5, 0.1)
    np.testing.assert_allclose(reading[:6], encoders.angle(state[:6]), atol=1e-14)
    np.testing.assert_allclose(reading[6:], 0.5 * encoders.angle(np.ones(6)), atol=1e-12)


def test_where_the_motors_are_follows_from_what_all_errors_make_of_it():
    config = EncoderConfig(side="motor", eccentricity_deg=5.0, scale_ppm=np.full(6, 1e4))
    encoders = Encoders(ROBOT, config)
    true = np.random.default_rng(0).uniform(-3.0, 3.0, (20, 6))
    np.testing.assert_allclose(encoders.true_position(encoders.angle(true)), true, atol=1e-14)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"side": "flange"}, "side must be one of joint, motor, got 'flange'"),
        ({"bits": 40}, "bits must be between 0 and 32, got 40"),
        ({"eccentricity_deg": -1.0}, "eccentricity_deg must be between 0 and 10 deg, got -1"),
    ],
)
def test_refuses_what_no_encoder_is(change: dict, message: str):
    with pytest.raises(ValueError, match=message):
        Encoders(ROBOT, replace(EncoderConfig(), **change))
