"""How markers appear in the images: their size, and which of them as one."""

import numpy as np

from systems.vision.tracking.marker_images import (
    image_shares,
    marker_diameters,
    merged_images,
    shared_images,
    touching,
)
from tests.systems.vision.rigs import BODY, CAMERAS, placed, random_pose


def test_the_diameter_is_that_of_the_projected_sphere():
    """Across the line of sight a sphere is seen at its diameter; the lens changes it by some percent."""
    p_W = placed(random_pose(np.random.default_rng(0)), BODY.p_E)
    for i, X_WC in enumerate(CAMERAS.R_WC):
        radius = 0.5 * BODY.diameter * X_WC[:, 0]
        across = np.linalg.norm(CAMERAS.project(p_W + radius)[i] - CAMERAS.project(p_W - radius)[i], axis=-1)
        np.testing.assert_allclose(marker_diameters(CAMERAS, BODY, p_W)[i], across, rtol=0.05)


def test_images_touch_when_they_are_nearer_than_their_mean_diameter():
    pixels = np.array([[[0.0, 0], [7.9, 0], [0, 8.1]]])
    close = touching(pixels, np.array([[10.0, 6.0, 6.0]]))[0]
    np.testing.assert_array_equal(close, [[False, True, False], [True, False, False], [False, False, False]])


def test_touching_markers_shine_as_one_amid_them_weighted_by_size():
    pixels = np.array([[[0.0, 0], [9, 0], [40, 0], [18, 0]]])
    diameters = np.array([[10.0, 10.0, 10.0, 10.0]])
    seen = np.ones((1, 4), bool)
    centers, shown = merged_images(pixels, seen, diameters)
    np.testing.assert_array_equal(shown, [[True, False, True, False]])
    np.testing.assert_allclose(centers[0, [0, 2]], [[9, 0], [40, 0]])
    centers, shown = merged_images(pixels, np.array([[True, False, True, True]]), diameters)
    np.testing.assert_array_equal(shown, [[True, False, True, True]])
    np.testing.assert_array_equal(centers[0, [0, 3]], pixels[0, [0, 3]])
    centers, _ = merged_images(pixels, seen, np.array([[16.0, 4.0, 10.0, 1.0]]))
    np.testing.assert_allclose(centers[0, 0], [9.0 * 4.0**2 / (16.0**2 + 4.0**2), 0.0])


def test_every_marker_that_is_seen_has_a_share_in_one_blob():
    rng = np.random.default_rng(0)
    pixels, diameters = rng.uniform(0.0, 60.0, (40, 9, 2)), rng.uniform(5.0, 12.0, (40, 9))
    close, seen = touching(pixels, diameters), rng.uniform(size=(40, 9)) < 0.8
    share = image_shares(close, seen, diameters)
    np.testing.assert_array_equal(np.count_nonzero(share, axis=1), seen)  # in one blob, or none
    np.testing.assert_allclose(share.sum(2), share.any(2))
    together = (share.swapaxes(1, 2) > 0.0).astype(float) @ (share > 0.0) > 0.0
    both = seen[:, :, None] & seen[:, None]
    assert np.all(together[close & both])
    shared = shared_images(close, seen, diameters)
    assert shared.any(2).sum() == np.sum(np.count_nonzero(share, axis=2) > 1) >= 20


def test_lone_markers_share_nothing():
    pixels = np.array([[[0.0, 0], [50, 0], [0, 50]]])
    diameters, seen = np.full((1, 3), 8.0), np.ones((1, 3), bool)
    close = touching(pixels, diameters)
    np.testing.assert_array_equal(image_shares(close, seen, diameters), [np.eye(3)])
    assert shared_images(close, seen, diameters).shape == (1, 0, 3)
