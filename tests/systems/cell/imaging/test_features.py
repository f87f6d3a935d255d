"""Features: what cameras report of markers, and how often it is missing, merged or false."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.kinematics.arm_capsules import Capsules
from systems.cell.imaging.features import FeatureConfig, FeatureSource
from systems.vision.tracking.marker_images import marker_diameters
from tests.systems.vision.rigs import BODY, CAMERAS, CELL, placed, random_pose

APART = {"merging": False}


def source(**config) -> FeatureSource:
    return FeatureSource(CAMERAS, CELL.windows, BODY, FeatureConfig(**config))


def pictures(features: FeatureSource, X_WE: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([features.blobs(X_WE, rng.standard_normal(features.noise_size)) for _ in range(count)])


def number_of(blobs: np.ndarray) -> int:
    return int((~np.isnan(blobs[..., 0])).sum())


X = random_pose(np.random.default_rng(3))
TRUE = CAMERAS.project(placed(X, BODY.p_E))


def test_without_noise_the_blobs_are_the_projected_centres_in_the_order_of_rows():
    blobs = pictures(source(pixel_sigma=0.0, **APART), X, 1)[0]
    for seen, true in zip(blobs, TRUE, strict=True):
        np.testing.assert_array_equal(seen[: len(BODY)], true[np.argsort(true[:, 1])])
        assert np.isnan(seen[len(BODY) :]).all()


def test_the_same_numbers_give_the_same_blobs():
    features = source(missing=0.2, false=0.2)
    np.testing.assert_array_equal(pictures(features, X, 3), pictures(features, X, 3))


def test_noise_missing_and_false_blobs_come_as_often_as_declared():
    """300 pictures of 110 markers tell rates to 0.2 percent and sigma to 0.3 percent; four times that."""
    n = 300 * len(CAMERAS) * len(BODY)
    noisy = pictures(source(pixel_sigma=0.1, **APART), X, 300)
    offset = noisy[:, :, None] - TRUE[None, :, :, None]  # (picture, camera, marker, blob, 2)
    error = offset[np.abs(offset).max(-1) < 0.8]  # 8 sigma; no two markers of this view are that close
    assert len(error) == n
    assert error.std() == pytest.approx(0.1, rel=4.0 / np.sqrt(4 * n))
    missing = 1.0 - number_of(pictures(source(missing=0.1, **APART), X, 300)) / n
    assert abs(missing - 0.1) < 4.0 * np.sqrt(0.09 / n)
    false = number_of(pictures(source(false=0.05, **APART), X, 300)) / n - 1.0
    assert abs(false - 0.05) < 4.0 * np.sqrt(0.05 / n)


def test_what_the_arm_hides_is_not_reported():
    features = source(pixel_sigma=0.0, **APART)
    p_W = placed(X, BODY.p_E)
    middle = 0.5 * (CAMERAS.p_WC[4] + p_W[0])
    arm = Capsules(middle[None], middle[None], np.array([1e-3]))
    blobs = features.blobs(X, np.zeros(features.noise_size), arm)
    assert number_of(blobs) == TRUE[..., 0].size - 1
    assert np.linalg.norm(blobs[4] - TRUE[4, 0], axis=-1)[:10].min() > 1.0


def test_markers_one_behind_the_other_are_one_blob():
    """The body is turned until one camera sees two of its markers in a line."""
    i = 5
    p_WE = np.array([0.45, 0.0, 0.45])
    line_of_sight = p_WE - CAMERAS.p_WC[i]
    turned = np.eye(4)
    turned[:3, :3] = Rotation.align_vectors(line_of_sight, BODY.p_E[1] - BODY.p_E[0])[0].as_matrix()
    turned[:3, 3] = p_WE - turned[:3, :3] @ BODY.p_E[0]
    p_W = placed(turned, BODY.p_E)
    first, second = CAMERAS.project(p_W)[i, :2]
    np.testing.assert_allclose(first, second, atol=1e-6)
    blobs = pictures(source(pixel_sigma=0.0), turned, 1)[0, i]
    assert number_of(blobs) < len(BODY)
    assert np.nanmin(np.linalg.norm(blobs - first, axis=-1)) < marker_diameters(CAMERAS, BODY, p_W)[i, 0]


@pytest.mark.parametrize("change", [{"pixel_sigma": -0.1}, {"missing": 1.0}, {"false": 0.3}])
def test_refuses_what_cannot_be(change: dict):
    (name,) = change
    with pytest.raises(ValueError, match=f"features: {name} must .*got {change[name]}"):
        source(**change)
