"""Corrections of a deformed arm: exact where the arm can reach, small where it cannot, smooth everywhere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.description.model import load_robot
from robots.dynamics.modes import stretched
from robots.pose import pose_error
from systems.feedforward.arm_correction import CORRECTIONS, SigmoidDamping, smoothly_limited
from systems.feedforward.deformed_arm import DeformedArm

ROBOT = load_robot("kr16")
ARM = DeformedArm(ROBOT, 16.0)
WORKING = np.deg2rad([20.0, -70.0, 80.0, 10.0, 60.0, 0.0])
# Axes 2 and 3 such that the wrist stands above axis 1, and as in Reiner's upright position.
OVER_AXIS_1 = np.array([0.3, -np.pi / 2, np.arcsin(-0.260 / np.hypot(0.670, 0.035)), 0.0, 0.0, 0.0])
UPRIGHT = np.array([0.3, -np.pi / 2, 0.0, 0.0, 0.0, 0.0])
RNG = np.random.default_rng(3)
DEFLECTION = 1e-3 * RNG.standard_normal(ARM.size)
ANGLES = st.floats(-1e3, 1e3)


def corrected(method: str, q: np.ndarray, ticks: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """The correction after some ticks, and the error of the tip that it leaves."""
    model, X_WE, turn = CORRECTIONS[method](ROBOT, ARM), ARM.pose(q, np.zeros(ARM.size)), np.zeros(6)
    for _ in range(ticks):
        turn = model.correction(q, DEFLECTION, X_WE, turn)
    return turn, pose_error(X_WE, ARM.pose(q + turn, DEFLECTION))


def test_least_squares_put_the_tip_back_where_it_was():
    before = pose_error(ARM.pose(WORKING, np.zeros(ARM.size)), ARM.pose(WORKING, DEFLECTION))
    assert np.linalg.norm(before) > 1e-3
    assert np.abs(corrected("least_squares", WORKING)[1]).max() < 1e-8


def test_one_step_leaves_an_error_of_the_second_order():
    """Corrections of millirads squared, times metres."""
    assert np.abs(corrected("least_squares", WORKING, 1)[1]).max() < 3e-5


def test_geometry_puts_back_the_position_alone():
    before = np.linalg.norm(ARM.pose(WORKING, DEFLECTION)[:, 3] - ARM.pose(WORKING, 0.0 * DEFLECTION)[:, 3])
    turn, error = corrected("geometric", WORKING)
    assert np.linalg.norm(error[3:]) < 0.15 * before
    assert not turn[3:].any()


def test_the_direct_solution_puts_back_the_position_exactly_in_one_tick():
    turn, error = corrected("direct", WORKING, 1)
    assert np.linalg.norm(error[3:]) < 1e-10
    assert np.abs(turn[:3]).max() > 1e-4
    assert not turn[3:].any()


def test_where_there_is_no_direct_solution_the_last_one_stays():
    """A metre beyond the reach."""
    model, last = CORRECTIONS["direct"](ROBOT, ARM), np.array([1e-3, 2e-3, -1e-3, 0.0, 0.0, 0.0])
    far = ARM.pose(stretched(ROBOT), np.zeros(ARM.size)).copy()
    far[:, 3] *= 1.5
    np.testing.assert_array_equal(model.correction(stretched(ROBOT), DEFLECTION, far, last), last)


@pytest.mark.slow
@pytest.mark.parametrize("method", CORRECTIONS)
@pytest.mark.parametrize(
    "q", [stretched(ROBOT), UPRIGHT, OVER_AXIS_1], ids=["stretched", "upright", "wrist over axis 1"]
)
def test_a_singular_or_unreachable_pose_is_corrected_a_little_and_without_drift(method: str, q: np.ndarray):
    """Deflections of a millirad turn joints by some; a thousand ticks turn them no further."""
    for nearby in (q, q + 1e-3 * RNG.standard_normal(6), q + 0.05 * RNG.standard_normal(6)):
        turn = corrected(method, nearby, 5)[0]
        assert np.abs(turn).max() < 0.05
        np.testing.assert_allclose(corrected(method, nearby, 1000)[0], turn, atol=1e-4)


def test_past_axis_1_the_correction_does_not_jump():
    """The wrist moves past axis 1 in steps of 4 mm."""
    model, turn, turns = CORRECTIONS["least_squares"](ROBOT, ARM), np.zeros(6), []
    for shift in np.arange(-0.5, 0.5, 6e-3):
        q = OVER_AXIS_1 + np.array([0.0, 0.0, shift, 0.0, 0.0, 0.0])
        turn = model.correction(q, DEFLECTION, ARM.pose(q, np.zeros(ARM.size)), turn)
        turns.append(turn)
    assert np.abs(np.diff(turns, axis=0)).max() < 1e-3


@given(st.floats(0.02, 1.0), st.floats(0.01, 0.5), st.floats(0.05, 1.0))
def test_damping_falls_between_its_limits_as_asked_for(largest: float, low: float, high: float):
    """(3.66) with (3.67)."""
    damping = SigmoidDamping(largest, 1e-3 * largest, (low, low + high))
    values = damping.at(np.linspace(0.0, 3.0, 400))
    assert (np.diff(values) <= 0.0).all()
    assert values.max() <= largest
    assert values.min() >= 0.99e-3 * largest
    np.testing.assert_allclose(damping.at(np.array([low, low + high])), [0.9 * largest, 1.1e-3 * largest])


@pytest.mark.parametrize(
    ("largest", "smallest", "bounds"),
    [(1.0, 0.0, (0.1, 0.2)), (1.0, 2.0, (0.1, 0.2)), (1.0, 0.85, (0.1, 0.2)), (1.0, 0.1, (0.2, 0.1))],
)
def test_damping_that_does_not_fall_is_refused(largest: float, smallest: float, bounds: tuple):
    with pytest.raises(ValueError, match="damping: must fall"):
        SigmoidDamping(largest, smallest, bounds)


@given(ANGLES, st.floats(1e-3, 1.0))
def test_the_limiter_is_odd_passes_small_angles_and_stops_large_ones(angle: float, limit: float):
    """(3.71) corrected; the printed third line gives -1 where 2 is the limit."""
    out = float(smoothly_limited(np.array(angle), limit))
    assert out == pytest.approx(-float(smoothly_limited(np.array(-angle), limit)), abs=1e-12)
    assert abs(out) <= limit + 2e-5
    if abs(angle) < 0.5 * limit:
        assert out == pytest.approx(angle, abs=2e-5)


def test_the_limiter_has_a_derivative_everywhere():
    x, limit = np.linspace(-0.2, 0.2, 200_001), 0.05
    slope = np.gradient(smoothly_limited(x, limit, 1e4), x)
    assert np.abs(np.diff(slope)).max() < 0.02
    assert slope[len(x) // 2] == pytest.approx(1.0, abs=2e-3)
