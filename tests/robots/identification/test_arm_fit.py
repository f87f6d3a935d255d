"""Standard deviations of a fit: how much parts of the data disagree."""

import numpy as np
import pytest

from robots.identification.arm_fit import condensed, part_of, scatter, widest

ROWS, PARTS, DRAWS = 40, 6, 4000


def mean_scatter(noise) -> tuple[np.ndarray, np.ndarray]:
    """Mean of the estimate over many draws of noise, and the true covariance of the solution, (2, 2) each.

    Nearly all that is known of the second unknown comes from the first part.
    """
    rng = np.random.default_rng(4)
    J = rng.normal(size=(PARTS, ROWS, 2))
    J[1:, :, 1] *= 0.1
    flat = J.reshape(-1, 2)
    covariance = np.linalg.inv(flat.T @ flat)
    found, solutions = [], []
    for _ in range(DRAWS):
        y = noise(rng)
        solution = covariance @ flat.T @ y.ravel()
        left = y - J @ solution
        found.append(scatter([part_of(*each) for each in zip(J, left, strict=True)], covariance))
        solutions.append(solution)
    return np.mean(found, axis=0), np.cov(np.transpose(solutions))


@pytest.mark.slow
def test_independent_noise_scatters_as_it_should_even_where_one_part_tells_nearly_all():
    """By the law of large numbers within some hundredths."""
    estimated, true = mean_scatter(lambda rng: rng.normal(size=(PARTS, ROWS)))
    np.testing.assert_allclose(np.diagonal(estimated), np.diagonal(true), rtol=0.1)


@pytest.mark.slow
def test_what_is_wrong_alike_within_a_part_counts():
    """Noise would be thought to average out over the rows of a part; this does not."""

    def noise(rng: np.random.Generator) -> np.ndarray:
        return np.sqrt(0.5) * (rng.normal(size=(PARTS, ROWS)) + rng.normal(size=(PARTS, 1)))

    def alike(rng: np.random.Generator) -> np.ndarray:
        return noise(rng)[:, rng.permutation(ROWS)]

    estimated, true = mean_scatter(alike)
    np.testing.assert_allclose(np.diagonal(estimated), np.diagonal(true), rtol=0.3)


def test_a_single_part_disagrees_with_none():
    J = np.eye(3)
    assert not scatter([part_of(J, np.ones(3))], np.eye(3)).any()


def test_of_several_scatters_each_unknown_has_the_widest_and_they_stay_a_covariance():
    ways = [M @ M.T for M in np.random.default_rng(4).normal(size=(3, 5, 5))]
    found = widest(ways)
    np.testing.assert_allclose(np.diagonal(found), np.max([np.diagonal(way) for way in ways], axis=0))
    assert np.linalg.eigvalsh(found).min() > 0.0


def test_condensed_residuals_have_the_same_squares_gradient_and_information():
    rng = np.random.default_rng(3)
    J, residuals = rng.normal(size=(500, 4)) * [1.0, 1e3, 1e-3, 1.0], rng.normal(size=500)
    whole = part_of(J, residuals)
    short, derivatives = condensed(whole.pull, whole.information, float(residuals @ residuals))
    assert short.shape == (5,)
    # Columns differ by 1e6 in size, of which the Cholesky factor loses nothing.
    np.testing.assert_allclose(short @ short, residuals @ residuals, rtol=1e-12)
    np.testing.assert_allclose(derivatives.T @ short, whole.pull, rtol=1e-9)
    np.testing.assert_allclose(derivatives.T @ derivatives, whole.information, rtol=1e-9, atol=1e-9)
