"""Matching with a prediction: near enough, and beyond doubt."""

import numpy as np
import pytest

from systems.vision.tracking.matching import match_to_prediction, unexplained_share

NOWHERE = [np.nan, np.nan]


def matched(predicted: list, blobs: list, gate: float = 3.0) -> list[int]:
    return match_to_prediction(np.array([predicted], float), np.array([blobs], float), gate)[0].tolist()


def test_a_blob_inside_the_gate_is_the_marker():
    assert matched([[0, 0], [50, 0]], [[51, 1], [1, -1], [200, 200]]) == [1, 0]


def test_the_gate_is_a_circle():
    assert matched([[0, 0]], [[2.1, 2.1]]) == [0]
    assert matched([[0, 0]], [[2.2, 2.2]]) == [-1]


def test_two_blobs_at_one_marker_are_a_doubt():
    assert matched([[0, 0], [50, 0]], [[1, 0], [-1, 0], [50, 0]]) == [-1, 2]


def test_one_blob_at_two_markers_is_a_doubt():
    assert matched([[0, 0], [4, 0], [50, 0]], [[2, 0], [50, 1]]) == [-1, -1, 1]


def test_missing_blobs_and_markers_that_are_not_expected_match_nothing():
    assert matched([[0, 0], NOWHERE], [NOWHERE, [0, 1], [0, 0.5]], gate=0.7) == [2, -1]
    assert matched([NOWHERE], [NOWHERE]) == [-1]


def test_each_camera_is_on_its_own():
    predicted = np.zeros((2, 1, 2))
    blobs = np.array([[[1.0, 0], [9, 9]], [[9, 9], [0, 1]]])
    np.testing.assert_array_equal(match_to_prediction(predicted, blobs, 3.0), [[0], [1]])


@pytest.mark.parametrize(
    ("blobs", "share"),
    [
        ([[0, 0], [100, 100]], 0.0),
        ([[0, 0], [50, 50]], 0.5),
        ([[0, 0], [500, 500]], 0.0),  # not about the body
        ([[50, 50], NOWHERE], 1.0),
        ([NOWHERE, NOWHERE], 0.0),
    ],
)
def test_unexplained_is_what_lies_about_the_body_and_at_no_marker_of_it(blobs: list, share: float):
    predicted = np.array([[[0.0, 0], [100, 100], NOWHERE]])
    assert unexplained_share(predicted, np.array([blobs], float), 5.0) == share
