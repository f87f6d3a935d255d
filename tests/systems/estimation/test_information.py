"""Sums of what samples say, against the formulas that they stand for."""

import numpy as np
import pytest

from systems.estimation import kernels
from systems.estimation.kernels.arrays import OpenKeyframe

RNG = np.random.default_rng(0)


def information(n: int) -> np.ndarray:
    H = RNG.normal(size=(2 * n, n))
    return H.T @ H


@pytest.mark.parametrize("n", [7, 54])
@pytest.mark.parametrize("gears", [0, 6])  # joints that may be off by more than a camera shows
def test_the_estimate_after_a_sample_is_that_of_least_squares(n, gears):
    weight, J, by_gears = 0.7, RNG.normal(size=(6, 6)), RNG.uniform(1.0, 3.0, gears)
    r, H, xi, weights = RNG.normal(size=6), RNG.normal(size=(6, n)), RNG.normal(size=n), np.arange(1.0, 7.0)
    A, b, at = information(n), RNG.normal(size=n), np.zeros(n)
    P, taken = np.linalg.inv(A), np.zeros(1)
    W = weight * np.linalg.inv(np.diag(1.0 / weights) + (J[:, :gears] * by_gears) @ J[:, :gears].T)
    A_then = A + H.T @ W @ H
    at_first, wanted = xi.copy(), np.linalg.solve(A_then, b + H.T @ W @ (r + H @ xi))
    shapes = ((n, n), (n,), (1,), (1,), (6,), (31 + gears,), (6,), (6, n))
    keyframe = OpenKeyframe(*(np.zeros(shape) for shape in shapes))
    seen = np.arange(6.0), np.ones(12), np.ones(6), 2.0, np.empty((0, 6))
    known, limits = (P, taken, b, at, np.ones(n), n), (1.0, 1e3)
    sample = r, np.ones(6), H, xi, seen, (weights, J, by_gears), weight
    is_far = kernels.information.take(*sample, keyframe, known, limits)
    assert not is_far
    assert taken[0] == 1.0
    np.testing.assert_allclose(P, np.linalg.inv(A_then), atol=1e-12 * np.abs(P).max())
    np.testing.assert_allclose(xi, wanted, rtol=1e-9)
    np.testing.assert_allclose(keyframe.means[[1, 30]], [weight, 2.0 * weight])
    np.testing.assert_allclose(keyframe.means[31:], weight * by_gears)
    np.testing.assert_allclose(keyframe.y, weight * (r + H @ at_first))
    np.testing.assert_allclose(np.tril(keyframe.A), np.tril(A_then - A), atol=1e-12)


@pytest.mark.parametrize("n", [1, 5, 12, 54])
def test_a_covariance_is_worked_out_from_the_factor_of_its_inverse(n):
    A, P = information(n), np.empty((n, n))
    L = np.linalg.cholesky(A)
    L[np.triu_indices(n, 1)] = np.nan  # which nobody reads
    kernels.information.invert(L, P)
    np.testing.assert_allclose(P @ A, np.eye(n), atol=1e-9)
    np.testing.assert_array_equal(P, P.T)


def test_what_is_no_covariance_any_more_stays_as_it_is_and_is_said():
    P, taken, H = -np.eye(7), np.zeros(1), 2.0 * np.eye(6, 7)
    before, zeros = P.copy(), np.zeros(7)
    shapes = ((7, 7), (7,), (1,), (1,), (6,), (31,), (6,), (6, 7))
    keyframe = OpenKeyframe(*(np.zeros(shape) for shape in shapes))
    seen = np.zeros(6), np.zeros(12), np.zeros(6), 0.0, np.empty((0, 6))
    known, limits = (P, taken, zeros, zeros, np.ones(7), 7), (1.0, 1e3)
    ones = np.ones(6)
    noise = ones, np.eye(6), np.empty(0)
    kernels.information.take(ones, ones, H, np.zeros(7), seen, noise, 1.0, keyframe, known, limits)
    np.testing.assert_array_equal(P, before)
    assert np.isinf(taken[0])
