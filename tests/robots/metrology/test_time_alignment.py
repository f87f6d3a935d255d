"""Lags between signals: exact for shifted signals, in both directions, and refused where there is none."""

import numpy as np
import pytest

from robots.metrology.time_alignment import AlignmentError, align, clock_model

PERIOD = 1e-3  # s


def pulse(shift: float) -> np.ndarray:
    """A short motion that rings, later by a shift in s; shape (2000, 2)."""
    t = np.arange(2000) * PERIOD - 0.5 - shift
    after = np.maximum(t, 0.0)
    ringing = np.sin(60.0 * after) * np.exp(-8.0 * after) * np.square(1.0 - np.exp(-30.0 * after))
    hump = np.exp(-0.5 * np.square(t / 0.04))
    return np.stack([ringing + 0.3 * hump, hump], axis=1)


@pytest.mark.parametrize("lag", [0.0, 0.0123456, -0.0407, 3.4e-4])
def test_a_lag_of_either_sign_is_found_to_hundredths_of_a_sample(lag: float):
    found = align(pulse(0.0), pulse(lag), PERIOD, window=0.1)
    assert found.lag == pytest.approx(lag, abs=0.02 * PERIOD)
    assert found.correlation > 0.99


def test_the_lag_back_is_the_negative():
    """With the branch m < 0 as printed in (4.3), R_xy(-m), both would be positive."""
    there, back = (align(pulse(a), pulse(b), PERIOD, 0.1).lag for a, b in ((0.0, 0.03), (0.03, 0.0)))
    assert there == pytest.approx(-back, abs=1e-9)


def test_noise_moves_it_by_less_than_a_sample():
    rng = np.random.default_rng(3)
    noisy = pulse(0.0123) + 0.1 * rng.normal(size=(2000, 2))
    assert align(pulse(0.0), noisy, PERIOD, 0.1).lag == pytest.approx(0.0123, abs=PERIOD)


def test_a_lag_beyond_the_window_is_refused():
    with pytest.raises(AlignmentError, match=r"no lag within \+-0.02 s"):
        align(pulse(0.0), pulse(0.1), PERIOD, window=0.02)


def test_signals_of_different_motions_are_refused():
    rng = np.random.default_rng(1)
    with pytest.raises(AlignmentError, match="correlation of 0"):
        align(pulse(0.0), rng.normal(size=(2000, 2)), PERIOD, window=0.1)


def test_a_signal_at_rest_is_refused():
    with pytest.raises(AlignmentError, match="does not change"):
        align(pulse(0.0), np.ones((2000, 2)), PERIOD, window=0.1)


def test_a_clock_is_known_from_lags_at_two_times_or_more():
    times = np.array([0.0, 40.0, 100.0])
    clock = clock_model(times, 0.25 + 30e-6 * times)
    assert (clock.offset, clock.drift_ppm) == pytest.approx((0.25, 30.0))
    np.testing.assert_allclose(clock.time(times * (1 + 30e-6) + 0.25), times, atol=1e-12)
