"""Hysteresis operators: memory, exact inverse, and how near the smooth one comes."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import trapezoid

from robots.drivetrain.counterbalance import Counterbalance
from robots.drivetrain.dahl import DahlHysteresis
from robots.drivetrain.hysteresis import PrandtlIshlinskii, SmoothPrandtlIshlinskii, pade_delay, play
from robots.drivetrain.motor import MotorLag
from robots.drivetrain.parts import PARTS, part_from

# The weights of table 2.1 with the thresholds from zero that the inverse needs (errata).
OPERATOR = PrandtlIshlinskii((0.2, 0.2, 0.2, 0.2, 0.2), (0.0, 0.1, 0.2, 0.3, 0.4))
signals = arrays(float, 50, elements=st.floats(-3.0, 3.0))


@given(signals)
def test_the_inverse_undoes_the_operator(x: np.ndarray):
    inverse, starts = OPERATOR.inverse()
    np.testing.assert_allclose(inverse.response(OPERATOR.response(x), starts), x, atol=1e-12)


@given(signals, signals)
def test_and_from_any_start_that_the_operator_can_have(x: np.ndarray, past: np.ndarray):
    start = np.zeros(5)
    for sample in past:
        start = play(sample, start, np.array(OPERATOR.thresholds))
    inverse, starts = OPERATOR.inverse(start)
    np.testing.assert_allclose(inverse.response(OPERATOR.response(x, start), starts), x, atol=1e-12)


def test_a_start_that_no_past_leads_to_is_refused():
    """Of two play operators one is at most as far behind the other as its threshold is larger."""
    with pytest.raises(ValueError, match="no input leads to the start"):
        OPERATOR.inverse(np.array([0.0, 0.06, -0.06, -0.06, -0.06]))


def test_a_deflection_that_lags_its_torque_loses_energy_in_a_cycle():
    """Torque times change of deflection; the inverse, a torque that leads its deflection, loses as much."""
    x = np.sin(np.linspace(0.0, 4.0 * np.pi, 4001))
    y = OPERATOR.response(x)
    cycle = slice(2000, 4001)
    work = trapezoid(x[cycle], y[cycle])
    # Each play operator of threshold r loses 4 r (1 - r) in a cycle of amplitude one.
    expected = sum(
        w * 4.0 * r * (1.0 - r) for w, r in zip(OPERATOR.weights, OPERATOR.thresholds, strict=True)
    )
    assert work == pytest.approx(expected, rel=1e-3)
    inverse, starts = OPERATOR.inverse()
    torque = inverse.response(y, starts)
    assert trapezoid(torque[cycle], y[cycle]) == pytest.approx(expected, rel=1e-3)


def test_small_motions_move_only_the_operator_without_threshold():
    x = np.concatenate([np.linspace(0.0, 1.0, 100), [1.0, 0.95, 1.0]])
    y = OPERATOR.response(x)
    assert y[-1] == pytest.approx(y[-3])
    assert y[-3] - y[-2] == pytest.approx(0.2 * 0.05)


@pytest.mark.parametrize("order", [1, 3, 6])
def test_the_pade_delay_is_stable_and_late_by_its_delay(order: int):
    """At low frequencies amplitude one and phase -w T, better with the order."""
    numerator, denominator = pade_delay(0.01, order)
    assert (np.roots(denominator).real < 0.0).all()
    w = 2.0 * np.pi * np.array([0.1, 1.0])
    response = np.polyval(numerator, 1j * w) / np.polyval(denominator, 1j * w)
    np.testing.assert_allclose(response, np.exp(-1j * w * 0.01), atol=0.01 if order == 1 else 1e-7)


def test_the_sixth_order_keeps_the_phase_to_50_hz():
    """Errata of (2.18): 5e-5 degrees at 50 Hz for n = 6 and 10 ms."""
    s = 2j * np.pi * 50.0
    numerator, denominator = pade_delay(0.01, 6)
    response = np.polyval(numerator, s) / np.polyval(denominator, s)
    error = np.angle(response / np.exp(-1j * 2.0 * np.pi * 50.0 * 0.01), deg=True)
    assert abs(error) == pytest.approx(5e-5, rel=0.2)


def test_the_smooth_operator_approaches_the_exact_one():
    times = np.arange(0.0, 4.0, 1e-3)
    x = np.sin(0.5 * np.pi * times) * np.sin(2.0 * np.pi * times)
    exact = OPERATOR.response(x)
    gaps = [
        np.abs(SmoothPrandtlIshlinskii(OPERATOR, sharpness, 0.01, 3).response(x, 1e-3) - exact).max()
        for sharpness in (25.0, 100.0)
    ]
    assert gaps[1] < 0.4 * gaps[0] < 0.04


def test_the_numerical_inverse_undoes_the_smooth_operator_to_rounding():
    times = np.arange(0.0, 1.5, 2e-3)
    x = np.sin(0.5 * np.pi * times) * np.sin(2.0 * np.pi * times)
    smooth = SmoothPrandtlIshlinskii(OPERATOR, 50.0, 0.01, 3)
    np.testing.assert_allclose(smooth.response(smooth.inverse_response(x, 2e-3), 2e-3), x, atol=1e-10)
    with pytest.raises(ValueError, match="weights must not be negative"):
        SmoothPrandtlIshlinskii(OPERATOR.inverse()[0], 50.0, 0.01, 3).inverse_response(x, 2e-3)


DAHL = DahlHysteresis((300.0, 100.0), (5e-4, 2e-3))


def test_a_hysteresis_of_torques_moves_as_its_rate_says_and_stays_bounded():
    x = 3e-3 * np.sin(np.linspace(0.0, 9.0, 20001)) * np.linspace(0.0, 1.0, 20001)
    z, jumped = np.zeros(2), np.zeros(2)
    for before, after in itertools.pairwise(x):
        z = z + DAHL.rate(z, np.array(after - before))
        assert (abs(z) <= DAHL.width).all()
    turning = [0, *(np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1), len(x) - 1]
    for start, stop in itertools.pairwise(turning):
        jumped = DAHL.moved(jumped, np.array(x[stop] - x[start]))
    np.testing.assert_allclose(jumped, z, atol=2e-7)


@pytest.mark.slow
@given(arrays(float, 12, elements=st.floats(-5e-3, 5e-3)))
def test_a_hysteresis_of_torques_loses_energy_in_every_cycle(corners: np.ndarray):
    """Once around a closed path of deflections, from wherever it has come to: work less what is stored."""
    z, path = np.zeros(2), np.concatenate([corners, corners[:1]])
    legs = np.concatenate([np.linspace(a, b, 200) for a, b in itertools.pairwise(path)])
    work, stored = 0.0, float(DAHL.energy(z))
    for turn in np.diff(legs):
        after = DAHL.moved(z, np.array(turn))
        work += 0.5 * float(DAHL.torque(z) + DAHL.torque(after)) * turn
        z = after
    assert work >= float(DAHL.energy(z)) - stored - 1e-9


def test_a_motor_follows_its_current_with_one_time_constant():
    motor, torque = MotorLag(0.01, 2.0), 0.0
    for _ in range(1000):
        torque += 1e-5 * float(motor.torque_rate(np.array(torque), np.array(3.0)))
    assert torque == pytest.approx(6.0 * (1.0 - np.exp(-1.0)), rel=1e-3)
    assert motor.current(
        np.array(torque), motor.torque_rate(np.array(torque), np.array(3.0))
    ) == pytest.approx(3.0)


@pytest.mark.parametrize("lateral", [0.0, 0.15])
def test_a_counterbalance_pulls_back_to_its_dead_centre_and_stores_what_it_takes(lateral: float):
    spring = Counterbalance(2e5, 5e3, 0.6, 0.2, -90.0, lateral, damping=300.0)
    q = np.linspace(-np.pi, 0.4, 200)
    h = 1e-6
    difference = -(spring.energy(q + h) - spring.energy(q - h)) / (2.0 * h)
    np.testing.assert_allclose(spring.torque(q), difference, rtol=1e-5, atol=1e-2)
    assert spring.torque(np.array(-np.pi / 2.0)) == pytest.approx(0.0, abs=1e-9)
    assert spring.torque(np.array(0.0)) < 0.0 < spring.torque(np.array(-np.pi))
    for velocity in (-2.0, 2.0):  # the damper only takes
        assert ((spring.torque(q, velocity) - spring.torque(q)) * velocity <= 1e-9).all()


def test_every_part_has_a_name_in_yaml_and_says_whether_it_can_be_inverted():
    spring = part_from({"kind": "cubic_spring", "c_0": 2e4, "gamma": 500})
    assert spring.torque(np.array(0.01)) == pytest.approx(2e4 * 0.01 * 1.05)
    gear = part_from(
        {
            "kind": "backlash",
            "spring": {"kind": "cubic_spring", "c_0": 1.0, "gamma": 0},
            "damping": 0,
            "gap": 0,
        }
    )
    assert gear.spring.c_0 == 1.0
    assert all(isinstance(part.invertible, bool) for part in PARTS.values())
    with pytest.raises(ValueError, match=r"kind must be one of sigmoid_friction, .* got 'rust'"):
        part_from({"kind": "rust"})
    with pytest.raises(ValueError, match="cubic_spring has no parameter 'd', it has c_0, gamma"):
        part_from({"kind": "cubic_spring", "d": 1.0})
    with pytest.raises(ValueError, match=r"cubic_spring: .*missing 1 required"):
        part_from({"kind": "cubic_spring", "c_0": 1.0})


@pytest.mark.parametrize(
    ("weights", "thresholds", "message"),
    [
        ((1.0, 1.0), (0.1, 0.2), r"must begin with 0 and increase, got \[0.1, 0.2\]"),
        ((1.0, 1.0, 1.0), (0.0, 0.2, 0.2), "must begin with 0 and increase"),
        ((1.0, -2.0), (0.0, 0.1), "partial sums of weights must be positive"),
        ((1.0,), (0.0, 0.1), "equally many"),
    ],
)
def test_operators_without_an_inverse_are_refused(weights, thresholds, message: str):
    with pytest.raises(ValueError, match=message):
        PrandtlIshlinskii(weights, thresholds)
