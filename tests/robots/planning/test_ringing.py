"""What of a motion makes an arm ring: spectra of splines."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from robots.description.model import load_robot
from robots.dynamics.modes import ModalAnalysis
from robots.planning.joint_path import straight_joint_path
from robots.planning.ringing import Band, ringing_band, ringing_rows
from robots.planning.time_spline import DEGREE, at_rest, fitted, knots

COUNT = 30
SWING = np.deg2rad([0.0, -60.0, 60.0, 0.0, 30.0, 0.0]), np.deg2rad([20.0, -60.0, 60.0, 0.0, 30.0, 0.0])


@pytest.fixture(scope="module")
def robot():
    return load_robot("kr16")


def coefficients() -> np.ndarray:
    x = np.linspace(0.0, 1.0, 400)
    return fitted(x, x - np.sin(2.0 * np.pi * x) / (2.0 * np.pi), 1.0, COUNT).coefficients


def test_over_all_frequencies_it_is_the_integral_of_the_square():
    """Parseval: twice the integral over positive frequencies is the integral over the motion."""
    c = coefficients()
    fifth = BSpline(knots(COUNT), c, DEGREE).derivative(5)
    x = np.linspace(0.0, 1.0, 20001)
    found = np.sum((ringing_rows(COUNT, 1.0, Band(1e-3, 150.0)) @ c) ** 2)
    assert 2.0 * found == pytest.approx(np.trapezoid(fifth(x) ** 2, x), rel=0.02)


def test_only_the_product_of_duration_and_frequency_counts():
    c = coefficients()
    once, slower = (
        ringing_rows(COUNT, 0.5, Band(10.0, 40.0)) @ c,
        ringing_rows(COUNT, 1.0, Band(5.0, 20.0)) @ c,
    )
    assert once == pytest.approx(slower)


def test_a_robot_at_rest_does_not_ring():
    """Where nothing moves all coefficients are alike, and splines of one constant have no derivatives."""
    rows = ringing_rows(COUNT, 0.5, Band(10.0, 40.0))
    assert np.abs(rows @ np.ones(COUNT)).max() < 1e-6 * np.abs(rows @ at_rest(COUNT)).max()


def test_the_band_begins_below_the_lowest_mode_and_ends_with_what_drives_are_told(robot):
    path = straight_joint_path(*SWING)
    low, high, damping = ringing_band(robot, 16.0, path)
    modes = ModalAnalysis(robot, "structure", 16.0).at(SWING[1])
    lowest = modes.frequency_hz[0]
    assert 0.8 * lowest < low < lowest
    assert high == pytest.approx(125.0)  # half of 1 / 4 ms
    assert 0.5 * modes.damping_ratio[0] < damping < modes.damping_ratio[0]


def test_what_rings_early_has_died_away_by_the_end():
    """A knock and its mirror image in time have the same spectrum; one of them has longer to decay."""
    band = Band(18.0, 22.0, damping=0.05)
    rows, undamped = (ringing_rows(COUNT, 0.5, each) for each in (band, band._replace(damping=0.0)))
    early, late = np.eye(COUNT)[[10, COUNT - 1 - 10]]
    assert np.linalg.norm(undamped @ early) == pytest.approx(np.linalg.norm(undamped @ late))
    assert np.linalg.norm(rows @ early) < 0.5 * np.linalg.norm(rows @ late)
    assert np.linalg.norm(rows @ late) < np.linalg.norm(undamped @ late)
