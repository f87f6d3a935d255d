"""How coarse encoders are, told from what they say, and what that does to the tip that is predicted."""

import numpy as np
import pytest

from robots.pose import pose_error
from systems.estimation.drives.encoder_steps import EncoderSteps
from systems.estimation.tip_estimator import TipEstimator
from systems.estimation.tip_estimator_config import TipEstimatorConfig
from tests.systems.estimation.arms import MovingArm, tip_model, true_unknowns

STEP = 2.0 * np.pi / 2**17  # rad


def rounded(theta: np.ndarray) -> np.ndarray:
    return STEP * np.round(theta / STEP)


def sigma_of(readings: np.ndarray) -> np.ndarray:
    steps = EncoderSteps()
    memory = steps.layout.view(np.zeros(steps.layout.size))
    steps.start(memory)
    for reading in readings:
        steps.hear(memory, reading)
    return steps.sigma(memory)


def smooth_motion() -> np.ndarray:
    """Joints that begin from rest and come back, one of which stays where it is, (n, 6)."""
    s = np.linspace(0.0, 2.0 * np.pi, 500)[:, None]
    return 0.3 + np.array([0.2, 0.1, 0.4, 0.05, 0.3, 0.0]) * (1.0 - np.cos(s)) ** 2


def test_what_readings_are_wrong_by_is_told_from_their_steps():
    theta = smooth_motion()
    sigma = sigma_of(rounded(theta))
    spread = (rounded(theta) - theta)[:, :5].std(axis=0)
    assert sigma[:5] == pytest.approx(np.full(5, STEP / np.sqrt(12.0)), rel=1e-6)
    assert sigma[:5] == pytest.approx(spread, rel=0.15)
    assert sigma[5] == 0.0


@pytest.mark.parametrize("when", [3, 60, 250])  # at rest, when it begins to move, on its way
def test_a_single_disturbed_reading_does_not_make_steps_smaller(when: int):
    readings = rounded(smooth_motion())
    readings[when] += 0.1 * STEP
    assert sigma_of(readings)[:5] == pytest.approx(np.full(5, STEP / np.sqrt(12.0)), rel=1e-6)


def test_encoders_without_steps_are_taken_as_exact():
    assert sigma_of(smooth_motion()).max() < 0.02 * STEP


def test_the_predicted_tip_is_as_wrong_as_its_covariance_says_when_all_else_is_known():
    model = tip_model()
    arm = MovingArm(model, true_unknowns(model, 3))
    estimator = TipEstimator(model, TipEstimatorConfig())
    memory = estimator.layout.view(np.zeros(estimator.layout.size))
    estimator.start(memory)
    memory.xi[:] = (arm.x - model.mean) / model.sigma
    memory.P[:] = 1e-14 * np.eye(model.size)
    sigma = np.full(6, STEP / np.sqrt(12.0))
    squares = []
    for time in np.linspace(0.0, 30.0, 200):
        pair = arm.pair(time, noise=0.0)
        read = pair._replace(theta=rounded(pair.theta), rounding=sigma)
        error = pose_error(estimator.predict(memory, read).X_WE[0], estimator.predict(memory, pair).X_WE[0])
        squares.append(error @ np.linalg.solve(estimator.tip_covariance(memory, read), error))
    assert np.mean(squares) == pytest.approx(6.0, rel=0.1)  # chi squared of six
