"""Gears: springs, ratios, losses and play; inverses to rounding, energy never created."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from robots.drivetrain.backlash import Backlash, ViscoElasticGear
from robots.drivetrain.efficiency import DirectionalEfficiency, SmoothEfficiency
from robots.drivetrain.friction import SigmoidFriction
from robots.drivetrain.ratio import FourierRatio
from robots.drivetrain.stiffness import CubicSpring, ExponentialSpring, LimitedSpring

SPRINGS = {
    "cubic": CubicSpring(2e4, 2e4),
    "exponential": ExponentialSpring(2e4, 6e4, 300.0),
    "limited": LimitedSpring(2e4, 2e4, 6e4, 1e-3),
}
deflections = st.floats(-0.05, 0.05)


@pytest.mark.parametrize("spring", SPRINGS.values(), ids=SPRINGS)
@given(deflection=deflections)
def test_a_spring_is_odd_its_tangent_is_its_derivative_and_its_inverse_undoes_it(spring, deflection: float):
    x, h = np.array(deflection), 1e-7
    assert spring.torque(-x) == pytest.approx(-spring.torque(x), abs=1e-12)
    difference = (spring.torque(x + h) - spring.torque(x - h)) / (2.0 * h)
    assert spring.stiffness(x) == pytest.approx(
        difference, rel=1e-3
    )  # the exponential one has a kink at zero
    assert spring.deflection(spring.torque(x)) == pytest.approx(deflection, rel=1e-12, abs=1e-16)


@pytest.mark.parametrize("spring", SPRINGS.values(), ids=SPRINGS)
def test_the_energy_is_the_integral_of_the_torque(spring):
    for deflection in (-0.03, 0.004, 0.05):
        exact = quad(lambda x: float(spring.torque(np.array(x))), 0.0, deflection, epsabs=1e-13)[0]
        assert spring.energy(np.array(deflection)) == pytest.approx(
            exact, rel=1e-4
        )  # where the limit is sharp
    assert (spring.energy(np.linspace(-0.05, 0.05, 11)) >= 0.0).all()


def test_what_springs_tend_to():
    """At rest c_0; far out the exponential one and the limited one's secant c_max."""
    for spring in SPRINGS.values():
        assert spring.stiffness(np.array(0.0)) == pytest.approx(2e4, rel=0.02)
    assert SPRINGS["exponential"].stiffness(np.array(0.2)) == pytest.approx(6e4, rel=1e-6)
    sharp = LimitedSpring(2e4, 2e4, 6e4, 1.0)
    assert sharp.torque(np.array(0.05)) / 0.05 == pytest.approx(6e4, rel=1e-3)
    tangents = sharp.stiffness(np.linspace(0.0, 0.02, 20001))
    assert tangents.max() == pytest.approx(3 * 6e4 - 2 * 2e4, rel=0.02)  # errata of (2.9)


@given(st.floats(-50.0, 50.0))
def test_an_uneven_gear_turns_on_average_with_its_ratio_and_can_be_turned_back(angle: float):
    gear = FourierRatio(100.0, (3.0, 1.0), (1, 7), (0.4, -1.0), 0.2)
    x = np.array(angle)
    assert gear.output_angle(gear.input_angle(x)) == pytest.approx(angle, rel=1e-13, abs=1e-13)
    turn = gear.input_angle(x + 2.0 * np.pi) - gear.input_angle(x)
    assert turn == pytest.approx(2.0 * np.pi * 100.0)
    h = 1e-6
    difference = (gear.input_angle(x + h) - gear.input_angle(x - h)) / (2.0 * h)
    assert gear.ratio(x) == pytest.approx(difference, rel=1e-6)
    power_in = gear.input_torque(np.array(5.0), x) * gear.ratio(x)  # at one rad/s of the output
    assert power_in == pytest.approx(-5.0)


def test_the_error_of_a_position_is_that_of_the_whole_angle_with_its_derivative():
    for amplitude in (-2e-5 * 200.0 * 100.0, 3.0):  # 20 urad at the output; a bad gear
        gear, theta = (
            FourierRatio(100.0, (amplitude, 0.1), (200.0, 3.0), (0.4, 0.0)),
            np.linspace(0.0, 1.0, 301),
        )
        error, slope = gear.position_error(theta)
        np.testing.assert_allclose(error, gear.output_angle(100.0 * theta) - theta, atol=1e-9)
        h = 1e-7
        after, before = gear.position_error(theta + h)[0], gear.position_error(theta - h)[0]
        np.testing.assert_allclose(slope, (after - before) / (2.0 * h), atol=1e-6)
    assert abs(
        FourierRatio(100.0, (-0.4,), (200.0,), (0.0,)).position_error(theta)[0]
    ).max() == pytest.approx(2e-5, rel=0.01)


EFFICIENCY = DirectionalEfficiency(0.9, 0.8, 0.1, 0.1)


@given(load=st.floats(-300.0, 300.0), speed=st.floats(-3.0, 3.0))
def test_the_loss_of_a_load_never_drives_and_is_what_the_efficiencies_say(load: float, speed: float):
    t, w = np.array(load), np.array(speed)
    loss = float(EFFICIENCY.loss(t, w))
    assert loss * speed >= 0.0
    if abs(speed) > 0.1 and load:  # beyond the smooth change
        forward, backward = EFFICIENCY.both(w)
        needed = load / forward if load * speed > 0.0 else load * backward
        assert load + loss == pytest.approx(float(needed))


SMOOTH = SmoothEfficiency(EFFICIENCY, 1.0, SigmoidFriction(5.0, 5.0, 100.0), 100.0)


@given(torque=st.floats(-300.0, 300.0), speed=st.floats(-3.0, 3.0))
def test_a_gear_never_gives_more_power_than_it_takes(torque: float, speed: float):
    t, w = np.array(torque), np.array(speed)
    given_out = float(SMOOTH.output_torque(t, w)) * speed
    assert given_out <= torque * speed + 0.02 * (
        1.0 + abs(torque * speed)
    )  # the smooth change costs a little
    exact = float(EFFICIENCY.factor(t, w)) * torque * speed
    assert exact <= torque * speed + 1e-12


@pytest.mark.slow
@given(torque=st.floats(-300.0, 300.0), speed=st.floats(-3.0, 3.0))
def test_the_smooth_losses_can_be_undone(torque: float, speed: float):
    t, w = np.array(torque), np.array(speed)
    again = SMOOTH.input_torque(SMOOTH.output_torque(t, w), w)
    assert again == pytest.approx(torque, rel=1e-9, abs=1e-9)


def test_the_smooth_losses_change_smoothly_with_the_torque():
    """The slope with which the inverse is found, against differences across the change of direction."""
    torque, speed, h = np.linspace(-3.0, 3.0, 201), np.array(0.3), 1e-6
    difference = (SMOOTH.loss(torque + h, speed) - SMOOTH.loss(torque - h, speed)) / (2.0 * h)
    np.testing.assert_allclose(SMOOTH._load_loss(torque, speed)[1], difference, atol=1e-7)


def test_far_from_rest_the_smooth_losses_are_the_exact_ones():
    for torque, speed in ((50.0, 1.0), (-50.0, 1.0), (50.0, -1.0)):
        t, w = np.array(torque), np.array(speed)
        expected = EFFICIENCY.factor(t, w) * torque - SMOOTH.friction.torque(w)
        assert SMOOTH.output_torque(t, w) == pytest.approx(expected, rel=1e-3)


def test_a_gap_transmits_nothing_and_beyond_it_the_spring_acts():
    gear = Backlash(CubicSpring(2e4, 0.0), 10.0, 0.002, centre=0.1)
    rest = np.zeros(3)
    np.testing.assert_array_equal(gear.torque(0.1 + np.array([-0.0009, 0.0, 0.0009]), rest), 0.0)
    np.testing.assert_allclose(gear.torque(0.1 + np.array([-0.003, 0.003, 0.0]), rest), [-40.0, 40.0, 0.0])
    assert gear.torque(np.array(0.1011), np.array(1.0)) == pytest.approx(2.0 + 10.0)


def test_teeth_that_meet_take_up_the_damper_without_a_jump():
    gear = Backlash(CubicSpring(2e4, 0.0), 10.0, 0.002)
    beyond = np.linspace(-1e-8, 3e-7, 3101)
    torque = gear.torque(0.001 + beyond, np.ones_like(beyond))
    assert np.diff(torque).max() < 0.02  # N m, of 10 at these 1e-10 rad
    np.testing.assert_allclose(torque[beyond > 1e-7 + 1e-9], 10.0, rtol=1e-3)


@pytest.mark.slow
def test_the_visco_elastic_gear_loses_energy_in_every_cycle_and_can_be_inverted():
    gear = ViscoElasticGear(CubicSpring(500.0, 7e5), 2e3, 1e3, 40.0)
    dt, work, x = 1e-5, 0.0, np.array(0.0)
    times = np.arange(0.0, 1.0, dt)
    phi, rate = 0.01 * np.sin(4.0 * np.pi * times), 0.04 * np.pi * np.cos(4.0 * np.pi * times)
    works = []
    for angle, speed in zip(phi, rate, strict=True):
        torque = gear.torque(np.array(angle), x)
        work += float(torque) * speed * dt
        works.append(work - float(gear.energy(np.array(angle), x)))
        x = x + dt * gear.rate(np.array(angle), x)
    assert works[-1] > 0.0
    assert np.diff(works)[100:].min() > -1e-6  # what is not stored is lost, at every moment
    back = gear.deflection(gear.torque(np.array(0.007), x), x)
    assert back == pytest.approx(0.007, rel=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CubicSpring(0.0, 1.0), "c_0 must be positive, got 0.0"),
        (lambda: ExponentialSpring(2e4, 1e4, 1.0), "c_max must be at least c_0"),
        (lambda: LimitedSpring(2e4, 1.0, 2e4, 1.0), "c_max must be above c_0"),
        (lambda: FourierRatio(1.0, (2.0,), (1,), (0.0,)), "the gear would turn back"),
        (lambda: DirectionalEfficiency(1.2, 0.8), r"forward must be in \(0, 1\], got 1.2"),
        (lambda: ViscoElasticGear(CubicSpring(1e3, 0.0), 1.0, 0.0, 1.0), "damped must be positive, got 0.0"),
    ],
)
def test_impossible_gears_are_refused(make, message: str):
    with pytest.raises(ValueError, match=message):
        make()
