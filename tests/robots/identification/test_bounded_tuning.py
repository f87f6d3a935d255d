"""Tuning on what is measured: it finds what differs, within its bounds, and leaves what is not shown."""

import numpy as np
import pytest

from robots.identification.fine_tuning.bounded_tuning import Sensitivity, tune

TIME = np.linspace(0.0, 4.0, 400)
PARTS = np.minimum(TIME.astype(int), 3)
NOISE = 5e-5  # m
DIRECTIONS = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, 0.6], [0.0, 0.0, 1.0]])
SAGS = np.stack([3e-3 * np.sin(3.0 * TIME), 2e-3 * np.cos(5.0 * TIME), np.zeros_like(TIME)])  # m, of springs


class Arm:
    """Three springs that bend under known loads; the last one has none."""

    def __init__(self, true: np.ndarray) -> None:
        self.true, self.runs = true, 0
        self._rng = np.random.default_rng(1)

    def deviation(self, x: np.ndarray) -> np.ndarray:
        """The tip less where a model with springs by exp(x) others has it, measured: (m, 3)."""
        self.runs += 1
        bent = np.exp(-self.true) - np.exp(-x)
        return (SAGS * bent[:, None]).T @ DIRECTIONS + NOISE * self._rng.normal(size=(len(TIME), 3))


def sensitivity(limit: float, sigma: float = 0.2) -> Sensitivity:
    slope = SAGS.T[:, None, :] * DIRECTIONS.T
    return Sensitivity(slope, PARTS, np.full(3, sigma), limit)


def found(true: list[float], limit: float, sigma: float = 0.2, runs: int = 5) -> np.ndarray:
    arm, of_model = Arm(np.array(true)), sensitivity(limit, sigma)
    spread, _ = of_model.weighed(arm.deviation(np.zeros(3)))
    arm.runs = 0
    x = tune(arm.deviation, of_model, spread, runs)
    assert arm.runs <= runs
    return x


def test_springs_that_differ_are_found_though_the_model_is_linear():
    """A spring that is 8 % off bends by 0.3 mm more: 400 samples of 0.05 mm say it to a thousandth."""
    x = found([0.08, -0.05, 0.0], limit=0.2)
    np.testing.assert_allclose(x[:2], [0.08, -0.05], atol=5e-3)


def test_bounds_are_kept_where_the_truth_is_beyond_them():
    x = found([0.4, -0.4, 0.0], limit=0.1)
    assert np.abs(x).max() <= 0.1
    np.testing.assert_allclose(x[:2], [0.1, -0.1], atol=2e-3)


def test_what_no_motion_shows_stays():
    of_model = sensitivity(0.2)
    gap = Arm(np.array([0.08, -0.05, 0.1])).deviation(np.zeros(3))
    assert of_model.shown(gap, at_least=0.1, at_most=3).tolist() == [0, 1]
    assert found([0.08, -0.05, 0.1], limit=0.2)[2] == pytest.approx(0.0, abs=1e-9)
    _, covariance = of_model.weighed(gap)
    np.testing.assert_allclose(np.sqrt(covariance[2, 2]), of_model.sigma[2], rtol=1e-6)


def test_what_is_known_well_moves_less():
    """What belief calls impossible is not done for a deviation that is hardly more than noise."""
    sure, unsure = (found([0.004, 0.0, 0.0], limit=0.2, sigma=sigma) for sigma in (1e-4, 0.2))
    assert abs(sure[0]) < 0.25 * abs(unsure[0])


def test_a_deviation_that_parts_of_the_motion_contradict_counts_for_little():
    """The same size of deviation, explained by a spring, or by another one on each edge."""
    of_model = sensitivity(0.2)
    alike = (SAGS[:1] * 0.05).T @ DIRECTIONS[:1]
    signs = np.where(PARTS % 2 == 0, 1.0, -1.0)[:, None]
    spread_alike, _ = of_model.weighed(alike)
    spread_apart, covariance = of_model.weighed(signs * alike)
    assert spread_apart > 3.0 * spread_alike
    assert np.sqrt(covariance[0, 0]) > 0.01
