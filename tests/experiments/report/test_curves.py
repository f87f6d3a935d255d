"""Curves of a page: fewer points, and the eye sees none of it."""

import numpy as np
import pytest

from experiments.report.curves import MOST_POINTS, coded, kept_points


def decoded(code: dict) -> np.ndarray:
    """As the browser does it."""
    sums, total = [], 0
    for step in code["d"]:
        total += step or 0
        sums.append(np.nan if step is None else total * code["s"])
    return 10.0 ** np.array(sums) if code["log"] else np.array(sums)


@pytest.mark.parametrize("frequency", [0.3, 3.0])
def test_a_smooth_curve_is_drawn_within_a_pixel_with_a_few_points(frequency: float):
    x = np.linspace(0.0, 1.0, 1400)
    y = np.sin(2.0 * np.pi * frequency * x)
    keep = kept_points(x, y)
    assert len(keep) < 500
    assert keep[0] == 0
    assert keep[-1] == len(x) - 1
    assert np.abs(np.interp(x, x[keep], y[keep]) - y).max() < np.ptp(y) / 500  # of a plot 500 pixels high


def test_a_peak_of_one_sample_is_not_lost():
    y = np.random.default_rng(0).normal(0.0, 1.0, 30000)
    y[17001] = 50.0
    keep = kept_points(np.arange(30000.0), y)
    assert 17001 in keep
    assert len(keep) <= MOST_POINTS


@pytest.mark.parametrize("peak", [50.0, -50.0])
def test_nor_is_one_beside_a_gap(peak: float):
    x = np.arange(30000.0)
    y = np.sin(1e-3 * x)
    y[::40] = np.nan
    for place in range(17001, 17039):
        peaked = y.copy()
        peaked[place] = peak
        keep = kept_points(x, peaked)
        assert place in keep
        assert np.isnan(peaked[keep]).sum() >= MOST_POINTS // 4


def test_a_loop_keeps_its_corners():
    there = np.linspace(0.0, 1.0, 100)
    x = np.concatenate([there, there[::-1]])
    y = np.concatenate([np.zeros(100), np.ones(100)])
    keep = set(kept_points(x, y).tolist())
    assert {0, 99, 100, 199} <= keep
    assert len(keep) < 30


def test_numbers_come_back_within_a_step_and_gaps_stay_gaps():
    values = np.array([0.0, 1.0, np.nan, -3.0, 2.5])
    assert decoded(coded(values)) == pytest.approx(values, abs=3.0 / 20000, nan_ok=True)
    small = np.array([1e-6, 3.0, 0.0, 250.0])
    assert decoded(coded(small, is_log=True)) == pytest.approx(
        [1e-6, 3.0, np.nan, 250.0], rel=3e-4, nan_ok=True
    )
