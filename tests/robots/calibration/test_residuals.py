"""Residuals in units of their noise: as wide as a fit leaves them, and uncorrelated."""

import numpy as np
import pytest

from robots.calibration.identification import IdentificationConfig, identify
from robots.calibration.measurements import SOURCE_NOISE, Measurements
from robots.calibration.residuals import expected_spread, standardised
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics


@pytest.mark.slow
@pytest.mark.parametrize("position_only", [False, True])
def test_known_noise_makes_standardised_residuals_as_wide_as_expected(position_only: bool):
    """Joint noise makes raw residuals of a row alike; made white they are not. Of 4800 numbers: 2 %."""
    robot, squares = load_robot("irb1200"), []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        q = rng.uniform(0.9 * robot.lower, 0.9 * robot.upper, (40, 6))
        X = Kinematics(robot).forward(q)
        rotation = None if position_only else X[:, :3, :3]
        table = Measurements(q, X[:, :3, 3], rotation).noisy(SOURCE_NOISE, rng)
        found = identify(robot, table, IdentificationConfig(noise=SOURCE_NOISE, search_outliers=False))
        squares.append(np.mean(standardised(found) ** 2) / expected_spread(found) ** 2)
        share = 27 / 120 if position_only else 30 / 240  # of parameters in numbers
        assert expected_spread(found) == pytest.approx(np.sqrt(1.0 - share), rel=0.03)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.04)
