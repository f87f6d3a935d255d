"""Between ticks and half a tick beyond: exact for polynomials of fifth degree, in equal parts."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from systems.feedforward.between_ticks import BetweenTicks


def moment(motion: Polynomial, time: float) -> np.ndarray:
    return np.array([[derivative(time)] for derivative in (motion, motion.deriv(), motion.deriv(2))])


@pytest.mark.parametrize(("period", "half"), [(4e-3, 1), (4e-3, 4), (0.25e-3, 1)])
def test_a_polynomial_of_fifth_degree_is_followed_exactly(period: float, half: int):
    between = BetweenTicks(period, 0.5 * period / half)
    motion = Polynomial([0.3, -2.0, 5.0, 40.0, -300.0, 2000.0])
    found = between.references(moment(motion, 0.2 - period), moment(motion, 0.2))
    times = 0.2 + between.substep * np.arange(1 - half, half + 1)
    assert between.substep * half == pytest.approx(0.5 * period)
    expected = np.array([moment(motion, time) for time in times])
    # Rounding of positions of 0.1 rad, over the square of the tick, in the accelerations.
    np.testing.assert_allclose(found[:, 0], expected[:, 0], rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], expected[:, 1], rtol=1e-8)
    np.testing.assert_allclose(found[:, 2], expected[:, 2], atol=1e-14 / period**2)


def test_before_the_first_tick_the_acceleration_was_constant():
    now = np.array([[0.4, -0.2], [1.0, 0.0], [3.0, -5.0]])
    found = BetweenTicks(4e-3, 2e-3).references(np.full((3, 2), np.nan), now)
    assert np.array_equal(found[0], now)
    np.testing.assert_allclose(found[1, 0], now[0] + 2e-3 * now[1] + 2e-6 * now[2], atol=1e-12)
    np.testing.assert_allclose(found[1, 2], now[2], atol=1e-6)


def test_a_sub_step_is_never_longer_than_asked_for():
    for period in (0.25e-3, 1e-3, 4e-3, 12e-3, 50e-3):
        between = BetweenTicks(period, 2e-3)
        assert between.substep <= 2e-3 * (1.0 + 1e-9)
        assert 2 * between.half * between.substep == pytest.approx(period)
