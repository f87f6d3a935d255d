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


def test_what_lies_between_two_times_of_the_log_is_left_out():
    predictions, times, truth = drawn(1.0)
    late = [(time + 2e-3, X, P) for time, X, P in predictions]
    assert coverage(late, times, truth) == {"share": None, "samples": 0}
