"""The share of predictions that hold the true tip: of honest ones 95 %, of bold ones hardly any."""

import numpy as np
import pytest

from diagrams.record.coverage import coverage
from systems.estimation.tip_model import moved

NUMBER = 2000
SIGMA = np.repeat([1e-4, 3e-5], 3)  # rad and m


def drawn(claimed: float):
    """Predictions that are wrong by SIGMA and claim a share of that, and the truth."""
    rng = np.random.default_rng(0)
    times = 4e-3 * np.arange(NUMBER)
    truth = np.tile(np.eye(4), (NUMBER, 1, 1))
    predicted = moved(truth, SIGMA * rng.normal(size=(NUMBER, 6)))
    covariance = np.diag((claimed * SIGMA) ** 2)
    return [(t, X, covariance) for t, X in zip(times, predicted, strict=True)], times, truth


def test_honest_predictions_hold_the_tip_in_95_of_100():
    found = coverage(*drawn(1.0))
    assert found["samples"] == NUMBER
    assert found["share"] == pytest.approx(0.95, abs=4.0 * np.sqrt(0.95 * 0.05 / NUMBER))


def test_bold_ones_do_not():
    assert coverage(*drawn(0.3))["share"] < 0.1


def test_between_two_times_of_the_log_the_tip_has_moved():
    """On a circle at 0.5 m/s: each prediction is right, and says so to 1 um."""
    times, radius, rate = 4e-3 * np.arange(500), 0.1, 5.0

    def tip(t: np.ndarray) -> np.ndarray:
        X_WE = np.tile(np.eye(4), (*np.shape(t), 1, 1))
        X_WE[..., 0, 3], X_WE[..., 1, 3] = radius * np.cos(rate * t), radius * np.sin(rate * t)
        return X_WE

    between = times[:-1] + np.linspace(0.0, 4e-3, 499)
    predictions = [(t, tip(t), 1e-12 * np.eye(6)) for t in between]
    assert coverage(predictions, times, tip(times)) == {"share": 1.0, "samples": 499}


def test_what_the_log_does_not_hold_is_left_out():
    predictions, times, truth = drawn(1.0)
    outside = [(time + times[-1] + 1.0, X, P) for time, X, P in predictions]
    assert coverage(outside, times, truth) == {"share": None, "samples": 0}
    has_gap = np.concatenate([times[:10], times[10:] + 1.0])
    in_gap = [(times[9] + 0.5, X, P) for _, X, P in predictions]
    assert coverage(in_gap, has_gap, truth) == {"share": None, "samples": 0}
