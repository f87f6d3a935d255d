"""Fixed markers: a camera that turns is named at once, one that stands still never."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.metrology.change_detection import cusum_changes
from systems.vision.reference_markers import SHIPPED, ReferenceMarkers
from tests.systems.vision.rigs import CAMERAS

SIGMA, RATE = 0.1, 250  # px, 1/s
MARKERS = ReferenceMarkers(CAMERAS, SHIPPED, SIGMA)


def turned(camera: int, vector: np.ndarray) -> np.ndarray:
    """Pixels after one camera has turned about its centre."""
    R = CAMERAS.R_WC.copy()
    R[camera] = Rotation.from_rotvec(vector).as_matrix() @ R[camera]
    return replace(CAMERAS, R_WC=R).project(SHIPPED)


def test_a_turn_is_estimated_as_it_is():
    vector = np.array([30e-6, -20e-6, 50e-6])
    found = MARKERS.rotations(turned(3, vector))
    np.testing.assert_allclose(found[3], vector, rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(np.delete(found, 3, axis=0), 0.0, atol=1e-12)


def test_noise_of_pixels_has_the_covariance_that_is_said():
    rng = np.random.default_rng(0)
    seen = MARKERS.pixels + SIGMA * rng.standard_normal((4000, *MARKERS.pixels.shape))
    white = MARKERS.whitened(MARKERS.rotations(seen)).reshape(4000, -1)
    np.testing.assert_allclose(np.cov(white.T), np.eye(white.shape[1]), atol=0.1)


@pytest.mark.parametrize("camera", [0, 3, 7])
@pytest.mark.parametrize("axis", range(3))
def test_a_camera_that_turns_by_50_microradians_is_named_within_a_second(camera, axis):
    """About an axis across its view; about the view itself the markers tell less."""
    vector = 50e-6 * CAMERAS.R_WC[camera][:, axis % 2]
    rng, start = np.random.default_rng(axis), RATE
    seen = np.tile(MARKERS.pixels, (3 * RATE, 1, 1, 1))
    seen[start:] = turned(camera, vector)
    seen += SIGMA * rng.standard_normal(seen.shape)
    white = MARKERS.whitened(MARKERS.rotations(seen)).reshape(len(seen), -1)
    first = cusum_changes(white)[0]
    assert first.channel // 3 == camera
    assert start <= first.at <= start + RATE
    assert {change.channel // 3 for change in cusum_changes(white)} == {camera}


@pytest.mark.slow
def test_in_eight_hours_no_camera_that_stands_still_is_named():
    """Means of 25 images: 8 h are 288 000 of them."""
    rng, changes = np.random.default_rng(1), []
    for _ in range(8):
        mean = SIGMA / 5.0 * rng.standard_normal((36_000, *MARKERS.pixels.shape), dtype=np.float32)
        white = 5.0 * MARKERS.whitened(MARKERS.rotations(MARKERS.pixels + mean))
        changes += cusum_changes(white.reshape(len(white), -1))
    assert changes == []
