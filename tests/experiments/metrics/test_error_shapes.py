"""The error along and across the path, and over frequency."""

import dataclasses

import numpy as np
import pytest

from experiments.metrics.error_shapes import camera_errors, error_spectrum, path_errors
from tests.experiments.synthetic import displaced, make_log, rectangle, straight

PERIOD = 0.004
TIME = np.arange(0.0, 8.0, PERIOD)


def test_a_tip_that_is_late_on_a_straight_path_lags_by_speed_times_delay_and_has_no_contour_error():
    late = make_log(TIME, straight(TIME, speed=0.1), straight(TIME - 0.02, speed=0.1))
    errors = path_errors(late)
    assert errors.lag == pytest.approx(0.002, abs=1e-12)
    assert errors.contour == pytest.approx(0.0, abs=1e-9)
    assert errors.length[-1] == pytest.approx(0.1 * TIME[-1])


def test_a_tip_beside_a_straight_path_has_a_contour_error_and_no_lag():
    beside = np.array([0.0, 0.0, 0.0, 0.0, 3e-3, 4e-3])
    path = straight(TIME)
    errors = path_errors(make_log(TIME, path, displaced(path, beside)))
    assert errors.contour == pytest.approx(5e-3)
    assert errors.lag == pytest.approx(0.0, abs=1e-12)


def test_both_parts_together_are_the_distance_on_any_path_also_where_it_stands_still():
    path = rectangle(TIME)
    error = np.random.default_rng(0).normal(0.0, 1e-3, (len(TIME), 6))
    errors = path_errors(make_log(TIME, path, displaced(path, error)))
    assert np.hypot(errors.lag, errors.contour) == pytest.approx(errors.distance, abs=1e-15)
    assert len(errors.time) == len(TIME)


def test_a_vibration_is_a_peak_at_its_frequency_and_the_density_holds_its_power():
    path = straight(TIME)
    error = np.zeros((len(TIME), 6))
    error[:, 4] = 1e-4 * np.sin(2.0 * np.pi * 20.0 * TIME)
    frequency, density = error_spectrum(make_log(TIME, path, displaced(path, error)))
    assert frequency[np.argmax(density)] == pytest.approx(20.0, abs=0.5)
    # The mean square of a sine is half the square of its amplitude.
    assert np.trapezoid(density**2, frequency) == pytest.approx(0.5e-8, rel=0.02)


def test_a_vibration_stays_at_its_frequency_where_exposures_are_missing():
    """The record of a station has a row for each exposure; where one did not come the time went on."""
    path = straight(TIME)
    error = np.zeros((len(TIME), 6))
    error[:, 4] = 1e-4 * np.sin(2.0 * np.pi * 12.0 * TIME)
    came = np.random.default_rng(0).random(len(TIME)) > 0.1
    tip = displaced(path, error)
    frequency, density = error_spectrum(make_log(TIME[came], path[came], tip[came]))
    assert frequency[np.argmax(density)] == pytest.approx(12.0, abs=0.5)
    assert np.trapezoid(density**2, frequency) == pytest.approx(0.5e-8, rel=0.05)


def test_samples_without_a_pose_are_left_out():
    path = straight(TIME)
    measured = displaced(path, np.array([0.0, 0.0, 0.01, 0.0, 1e-4, 0.0]))
    measured[100:200] = np.nan
    log = dataclasses.replace(make_log(TIME, path, path, measured))
    time, distance, angle = camera_errors(log)
    assert len(time) == len(TIME) - 100
    assert distance == pytest.approx(1e-4)
    assert angle == pytest.approx(0.01)
