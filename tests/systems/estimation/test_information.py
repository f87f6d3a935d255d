"""Sums of what samples say, against the formulas that they stand for."""

import numpy as np
import pytest

from systems.estimation import kernels
from systems.estimation.kernels.arrays import OpenKeyframe

RNG = np.random.default_rng(0)


def information(n: int) -> np.ndarray:
    H = RNG.normal(size=(2 * n, n))
    return H.T @ H


@pytest.mark.parametrize("n", [3, 4, 9])
def test_a_sum_of_two_informations_is_inverted(n):
    A, A_open, B, X = information(n), information(n), RNG.normal(size=(n, 6)), np.empty((n, 6))
    assert kernels.information.solve(A, A_open, B, X)
    np.testing.assert_allclose((A + A_open) @ X, B, atol=1e-9)


def test_what_is_no_information_is_refused():
    A = np.diag([1.0, 2.0, -1.0, 1.0, 1.0])
    assert not kernels.information.solve(A, np.zeros((5, 5)), np.ones((5, 1)), np.empty((5, 1)))


def test_the_estimate_after_a_sample_is_that_of_least_squares():
    n, weight = 7, 0.7
    r, H, xi, weights = RNG.normal(size=6), RNG.normal(size=(6, n)), RNG.normal(size=n), np.arange(1.0, 7.0)
    A, b, at = information(n), RNG.normal(size=n), np.zeros(n)
    wanted = np.linalg.solve(A + weight * H.T * weights @ H, b + weight * H.T * weights @ (r + H @ xi))
    shapes = ((n, n), (n,), (1,), (1,), (6,), (31,), (6,), (6, n))
    keyframe = OpenKeyframe(*(np.zeros(shape) for shape in shapes))
    seen = np.arange(6.0), np.ones(12), np.ones(6), 2.0, np.empty((0, 6))
    past, limits = (A, b, at, np.ones(n), n), (1.0, 1e3)
    is_far = kernels.information.take(r, np.ones(6), H, xi, seen, weights, weight, keyframe, past, limits)
    assert not is_far
    np.testing.assert_allclose(xi, wanted, rtol=1e-9)
    np.testing.assert_allclose(keyframe.means[[1, 30]], [weight, 2.0 * weight])
