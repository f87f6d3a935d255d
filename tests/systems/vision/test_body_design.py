"""Markers move to where a score is smaller, and keep what the tracker and the drawing of the body ask for."""

import numpy as np
import pytest

from systems.vision.body_design import distinct, optimised_markers, spacing
from systems.vision.marker_body import load_body

P = load_body("probst").p_E


def width(p_E: np.ndarray) -> float:
    """Small for markers that are far from their middle, as the rotation of a body wants them."""
    return -float(np.sum((p_E - p_E.mean(axis=0)) ** 2))


def test_markers_that_should_be_wide_go_outwards_within_the_box_and_stay_distinct():
    found = optimised_markers(P, width, 4000, 0, 0.06, 1e-3)
    assert width(found) < 1.1 * width(P)
    assert (found >= P.min(axis=0)).all()
    assert (found <= P.max(axis=0)).all()
    assert spacing(found) >= 0.06
    assert distinct(found) >= 1e-3


def test_what_is_best_already_stays():
    np.testing.assert_array_equal(
        optimised_markers(P, lambda p: float(np.any(p != P)), 200, 0, 0.06, 1e-3), P
    )


def test_limits_that_no_markers_keep_are_refused():
    for least, alike in ((1.0, 1e-3), (0.06, 0.05)):
        with pytest.raises(ValueError, match="none was found where these are"):
            optimised_markers(P, width, 100, 0, least, alike)


def test_markers_that_are_too_alike_come_apart_though_that_is_worse():
    square = 0.1 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.3]])
    assert distinct(square) < 1e-6
    found = optimised_markers(square, lambda p: float(np.any(p != square)), 2000, 0, 0.03, 1e-3)
    assert distinct(found) >= 1e-3
