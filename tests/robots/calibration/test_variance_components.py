"""Variances from residuals: the most likely ones, and found wherever the search begins."""

import numpy as np
import pytest
from scipy.optimize import minimize

from robots.calibration.identification import identify
from robots.calibration.solver.noise_model import NoiseModel
from robots.calibration.solver.problem import Linearised
from robots.calibration.solver.variance_components import variance_components
from robots.description.model import load_robot
from tests.robots.calibration.seen import corner_table

ROWS, PARAMETERS = 25, 20


def residuals_of(theta: np.ndarray, seed: int) -> Linearised:
    """Rows of which parameters of unit size and three noises are all there is to say."""
    rng = np.random.default_rng(seed)
    A, J = 1e-3 * rng.normal(size=(ROWS, 6, PARAMETERS)), rng.normal(size=(ROWS, 6, 6))
    instrument = np.sqrt(np.repeat(theta[[2, 1]], 3)) * rng.normal(size=(ROWS, 6))
    e = np.sqrt(theta[0]) * np.einsum("nij,nj->ni", J, rng.normal(size=(ROWS, 6))) + instrument
    return Linearised(A @ rng.normal(size=PARAMETERS) + e, A, J)


def improbability(at: Linearised, theta: np.ndarray) -> float:
    """Minus twice the log of the density of all residuals, by one dense covariance."""
    A, e = at.A.reshape(-1, PARAMETERS), at.residuals.ravel()
    V = A @ A.T + np.diag(np.tile(np.repeat(theta[[2, 1]], 3), ROWS))
    for row, J in enumerate(at.J):
        here = slice(6 * row, 6 * row + 6)
        V[here, here] += theta[0] * J @ J.T
    return float(np.linalg.slogdet(V)[1] + e @ np.linalg.solve(V, e))


@pytest.mark.parametrize(
    "sigmas", [(1e-4, 1e-4, 1e-4), (1e-3, 1e-4, 1e-3), (1e-4, 1e-3, 1e-5), (3e-4, 2e-4, 1e-3)]
)
def test_variances_are_the_most_likely_ones(sigmas: tuple[float, ...]):
    """Nelder and Mead on the dense density, above the floors of the instrument, find none more likely."""
    at, u = residuals_of(np.square(sigmas), seed=0), np.zeros(PARAMETERS)
    first = NoiseModel(np.array([1e-9, 1e-7, 1e-7]), np.ones((ROWS, 3)))
    least = np.maximum(first.floors(at.residuals), 1e-20)
    found = variance_components(at, u, first, [0, 1, 2]).theta

    def outside(logs: np.ndarray) -> float:
        return improbability(at, np.maximum(np.exp(logs), least))

    best = minimize(outside, np.log(np.square(sigmas)), method="Nelder-Mead", options={"fatol": 1e-6}).fun
    assert improbability(at, found) <= best + 0.01


def test_variances_do_not_depend_on_where_the_search_begins():
    """Sixty starts that are up to a thousand times off in either direction."""
    at, rng = residuals_of(np.square([1e-3, 1e-4, 3e-4]), seed=1), np.random.default_rng(2)
    found = []
    for _ in range(60):
        start = NoiseModel(10.0 ** rng.uniform(-11, -5, 3), np.ones((ROWS, 3)))
        theta = variance_components(at, np.zeros(PARAMETERS), start, [0, 1, 2]).theta
        found.append(improbability(at, theta))
    assert np.ptp(found) < 0.05  # of a logarithm: the estimate itself is uncertain by one


@pytest.mark.parametrize(("rows", "parameters"), [(4, 23), (4, 30), (6, 36)])
def test_kinds_of_noise_that_rows_cannot_tell_apart_are_said_to_be_unknown(rows: int, parameters: int):
    """The parameters leave one of all numbers or none: no variance is known to its own size."""
    noise = NoiseModel(np.array([0.0, 1e-7, 1e-7]), np.ones((rows, 3)))
    for seed in range(20):
        rng = np.random.default_rng(seed)
        A, J = 0.1 * rng.normal(size=(rows, 6, parameters)), rng.normal(size=(rows, 6, 6))
        flat, e = A.reshape(-1, parameters), 1e-4 * rng.normal(size=6 * rows)
        y = e + flat @ rng.normal(size=parameters)
        u = np.linalg.solve(flat.T @ flat + 1e-8 * np.eye(parameters), flat.T @ y)
        at = Linearised((y - flat @ u).reshape(rows, 6), A, J)
        with np.errstate(all="raise"):
            found = variance_components(at, u, noise, [1, 2])
        spread = np.sqrt(np.diagonal(found.covariance))
        assert np.linalg.eigvalsh(found.covariance / np.outer(spread, spread)).min() > 0.0
        assert np.any(spread > found.theta[1:])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 5, 9])
def test_springs_that_are_missing_are_no_hindrance(seed: int):
    """Measured at corners of the ranges, the joints seem so noisy that they hide the camera's noise."""
    found = identify(load_robot("irb1200"), corner_table(seed))
    assert np.linalg.norm(found.residuals[found.kept, 3:], axis=1).mean() < 4e-4  # m, about what it sags
