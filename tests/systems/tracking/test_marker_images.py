"""How markers appear in the images: their size, and which of them as one."""

import numpy as np

from systems.tracking.marker_images import marker_diameters, merged_images, touching
from tests.systems.tracking.rigs import BODY, CAMERAS, placed, random_pose


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
