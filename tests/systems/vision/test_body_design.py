"""Markers move to where a score is smaller, and keep what the tracker and the drawing of the body ask for."""

import numpy as np

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
