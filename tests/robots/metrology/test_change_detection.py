"""Cumulative sums and exponential averages: when they speak, and when they must not."""

import numpy as np
import pytest

from robots.metrology.change_detection import cusum_changes, ewma


def noise(n: int, channels: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((n, channels))


def test_a_step_is_found_where_it_began_with_its_size():
    residuals = noise(2000, 4)
    residuals[1200:, 2] -= 3.0
    (change,) = cusum_changes(residuals)
    assert change.channel == 2
    assert change.at - 1200 <= 20  # 2.5 a sample beyond the drift, up to 25
    assert abs(change.onset - 1200) <= 2
    assert abs(change.size + 3.0) < 4.0 * change.sigma


def test_noise_alone_is_never_a_change():
    assert cusum_changes(noise(400_000, 5)) == []


def test_sums_are_those_of_the_recursion_sample_by_sample():
    residuals = noise(300, 1, seed=4) + 0.8
    total, at = 0.0, None
    for i, value in enumerate(residuals[:, 0]):
        total = max(0.0, total + value - 0.5)
        if total > 25.0:
            at = i
            break
    assert cusum_changes(residuals)[0].at == at


def test_an_exponential_average_has_the_variance_that_is_said():
    means, variance = ewma(noise(6, 200_000), 0.3)
    np.testing.assert_allclose(means.var(axis=1), variance, rtol=0.02)
    with pytest.raises(ValueError, match="weight must be above 0 and at most 1, got 0"):
        ewma(means, 0.0)
