"""Friction: odd, against the motion, smooth, and what its parameters say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.drivetrain.friction import (
    PolynomialFriction,
    SigmoidFriction,
    StickSlipFriction,
    StribeckFriction,
    TanhFriction,
)

SIGMOID = SigmoidFriction(5.0, 5.0, 30.0)
CURVES = {
    "sigmoid": SIGMOID,
    "tanh": TanhFriction(5.0, 5.0, 0.05),
    "stribeck": StribeckFriction(SIGMOID, 40.0, 0.3),
    "polynomial": PolynomialFriction(0.5, 60.0, 0.1, 1.0, 0.3),
}
velocities = st.floats(-20.0, 20.0)


@pytest.mark.parametrize("friction", CURVES.values(), ids=CURVES)
@given(velocity=velocities)
def test_friction_is_odd_and_takes_energy(friction, velocity: float):
    v = np.array([velocity, -velocity])
    torque = friction.torque(v)
    assert torque[0] == pytest.approx(-torque[1], abs=1e-14)
    assert torque[0] * velocity >= 0.0


@pytest.mark.parametrize("friction", CURVES.values(), ids=CURVES)
@given(velocity=velocities)
def test_the_slope_is_the_derivative_and_continuous(friction, velocity: float):
    """Central differences over 1e-6; the steepest third derivative here is some 1e6 N m s^3 / rad^3."""
    h = 1e-6
    difference = (friction.torque(velocity + h) - friction.torque(velocity - h)) / (2.0 * h)
    assert friction.slope(np.array(velocity)) == pytest.approx(difference, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("name", ["sigmoid", "tanh", "polynomial"])
@given(a=velocities, b=velocities)
def test_without_stribeck_more_speed_means_more_friction(name: str, a: float, b: float):
    low, high = sorted((a, b))
    assert CURVES[name].torque(np.array(low)) <= CURVES[name].torque(np.array(high)) + 1e-12


def test_both_smooth_coulomb_curves_are_one():
    """2 / (1 + exp(-s v)) - 1 = tanh(s v / 2)."""
    v = np.linspace(-1.0, 1.0, 101)
    np.testing.assert_allclose(SIGMOID.torque(v), TanhFriction(5.0, 5.0, 2.0 / 30.0).torque(v), atol=1e-14)
    printed = 5.0 * v + 2.0 * 5.0 / (1.0 + np.exp(-30.0 * v)) - 5.0
    np.testing.assert_allclose(SIGMOID.torque(v), printed, atol=1e-12)


def test_the_stribeck_hump_is_highest_where_its_parameters_say():
    friction, v = StribeckFriction(SigmoidFriction(0.0, 0.0, 1.0), 40.0, 0.3), np.linspace(0.0, 1.0, 100001)
    hump = friction.torque(v)
    assert v[np.argmax(hump)] == pytest.approx(np.sqrt(0.3 / 40.0), abs=1e-5)
    assert hump.max() == pytest.approx(0.5 / np.sqrt(40.0 * 0.3))


def test_the_parts_of_the_polynomial_join():
    """Value and slope across both joints, to the change within 2e-9 rad/s."""
    friction = CURVES["polynomial"]
    for joint in (friction.step, 1.0):
        near, far = joint - 1e-9, joint + 1e-9
        assert friction.torque(np.array(near)) == pytest.approx(friction.torque(np.array(far)), abs=1e-7)
        assert friction.slope(np.array(near)) == pytest.approx(friction.slope(np.array(far)), abs=1e-5)
    assert friction.torque(np.array(1.0)) == pytest.approx(1.0)


def test_a_block_sticks_until_it_is_pushed_hard_enough_and_slips_then():
    friction = StickSlipFriction(0.0, 1.0, 1.5)
    velocity, direction, speeds = 0.0, np.array(0.0), []
    for k in range(4000):
        applied = 2.0 * k / 4000.0  # N m, on 1 kg m^2
        torque, direction = friction.step(np.array(velocity), np.array(applied), direction)
        velocity += 1e-3 * (applied - float(torque))
        speeds.append(velocity)
    speeds = np.array(speeds)
    first = np.flatnonzero(speeds > 0.0)[0]
    assert 2.0 * first / 4000.0 == pytest.approx(1.5, abs=2e-3)
    assert (np.diff(speeds[first:]) > 0.0).all()
    assert not StickSlipFriction.invertible


def test_a_coasting_block_sticks_when_its_velocity_changes_sign_within_a_step():
    """With steps of a millisecond no velocity is ever small; once it sticks it is at rest for good."""
    friction, v, direction = StickSlipFriction(0.1, 1.0, 1.5), 0.2345, np.array(1.0)
    for _ in range(1000):
        torque, direction = friction.step(np.array(v), np.array(0.3), direction)
        v = v + 1e-3 * (0.3 - float(torque)) if direction else 0.0
    assert direction == 0.0
    assert v == 0.0


@given(st.floats(-2.0, 2.0), st.floats(-5.0, 5.0), st.floats(0.01, 1.0))
def test_what_holds_never_drives_and_never_exceeds_the_breakaway_torque(v: float, applied: float, J: float):
    friction = StickSlipFriction(0.0, 1.0, 1.5)
    torque = float(friction.holding(np.array(v), np.array(applied), np.array(J)))
    assert torque * v >= 0.0
    assert abs(torque) <= 1.5
    at_rest = float(friction.holding(np.array(0.0), np.array(applied), np.array(J)))
    assert at_rest == pytest.approx(np.clip(applied, -1.5, 1.5))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SigmoidFriction(-1.0, 1.0, 1.0), "viscous must not be negative, got -1.0"),
        (lambda: SigmoidFriction(1.0, 1.0, 0.0), "steepness must be positive"),
        (lambda: PolynomialFriction(0.5, 60.0, 1.5, 1.0, 0.3), "step must be below 1 rad/s, got 1.5"),
        (
            lambda: PolynomialFriction(0.5, 60.0, 0.1, 1.0, 9.0),
            r"must not drive .* got -0\.\d+ N m at 0\.\d+",
        ),
        (lambda: PolynomialFriction(0.5, 60.0, 0.1, -1.0, 0.3), r"must not drive the motion, got -1"),
        (lambda: StribeckFriction(SIGMOID, 0.0, 1.0), "a must be positive"),
        (lambda: StickSlipFriction(0.0, 2.0, 1.0), "breakaway must be at least coulomb"),
    ],
)
def test_impossible_friction_is_refused(make, message: str):
    with pytest.raises(ValueError, match=message):
        make()
