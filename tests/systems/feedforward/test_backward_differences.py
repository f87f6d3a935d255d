"""Derivatives at the newest sample: exact for cubics, of the third and second order for anything smooth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from systems.feedforward.backward_differences import HISTORY, BackwardDifferences, at_rest, with_newest

SIZES = st.floats(-10.0, 10.0)


@given(st.lists(SIZES, min_size=4, max_size=4), st.floats(1e-3, 0.1))
def test_cubic_polynomials_are_differentiated_exactly(coefficients: list[float], period: float):
    cubic = np.polynomial.Polynomial(coefficients)
    newest, *before = (np.array([cubic(-k * period)]) for k in range(1 + HISTORY))
    rate, acceleration = BackwardDifferences(period).derivatives(newest, np.array(before))
    # Rounding of samples of the size of ten, divided by the period twice.
    assert rate == pytest.approx(coefficients[1], abs=1e-13 / period)
    assert acceleration == pytest.approx(2.0 * coefficients[2], abs=1e-13 / period**2)


def test_errors_fall_with_the_third_and_the_second_power_of_the_period():
    def errors(period: float) -> np.ndarray:
        newest, *before = (np.sin([1.0 - k * period]) for k in range(1 + HISTORY))
        rate, acceleration = BackwardDifferences(period).derivatives(newest, np.array(before))
        return np.abs([rate - np.cos(1.0), acceleration + np.sin(1.0)]).ravel()

    np.testing.assert_allclose(errors(0.02) / errors(0.01), [8.0, 4.0], rtol=0.1)


def test_a_signal_at_rest_stays_there_and_history_moves_on():
    history = at_rest(np.array([1.0, 2.0]))
    rates = BackwardDifferences(0.1).derivatives(np.array([1.0, 2.0]), history)
    np.testing.assert_allclose(rates, 0.0, atol=1e-12)
    moved = with_newest(np.array([5.0, 6.0]), history)
    np.testing.assert_array_equal(moved, [[5.0, 6.0], [1.0, 2.0], [1.0, 2.0]])
