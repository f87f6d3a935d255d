"""Variances from residuals: the most likely ones, and found wherever the search begins."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from robots.calibration.identification import identify
from robots.calibration.measurements import MeasurementNoise, Measurements
from robots.calibration.solver.noise_model import NoiseModel
from robots.calibration.solver.problem import Linearised
from robots.calibration.solver.variance_components import variance_components
from robots.description.calibration import Calibration
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import load_robot
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.kinematics.error_kinematics import ErrorKinematics

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


@pytest.mark.parametrize("seed", [0, 5, 9])
def test_springs_that_are_missing_are_no_hindrance(seed: int):
    """Measured at corners of the ranges, the joints seem so noisy that they hide the camera's noise."""
    robot, rng = load_robot("irb1200"), np.random.default_rng(seed)
    lower, upper, tilting = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), [1, 2, 4]
    q = rng.uniform(lower, upper, (30, 6))
    q[:, tilting] = np.where(rng.random((30, 3)) < 0.5, 0.9 * lower[tilting], 0.9 * upper[tilting])
    errors = GeometricErrors(np.arange(1.0, 4.0, 0.5), np.full(3, 10.0)).vector(robot)
    true = ErrorKinematics(robot).robot_with_errors(errors)
    soft = replace(true, calibration=Calibration(compliance=(1.0 / robot.joint_stiffness).tolist()))
    X_WE = CompliantKinematics(soft, 2.5).forward(q)
    table = Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3], np.full(30, 2.5))
    found = identify(robot, table.noisy(MeasurementNoise(0.0, 7e-6, 2.5e-5), rng))
    assert np.linalg.norm(found.residuals[found.kept, 3:], axis=1).mean() < 2e-4  # m, less than it sags
