"""A camera from known points: OpenCV finds the same one, and the truth is within its standard deviations."""

import cv2
import numpy as np
import pytest

from robots.metrology.least_squares import UndeterminedError
from systems.vision.calibration.camera_parameters import NUM_LENS
from systems.vision.calibration.known_points import calibrate_from_points
from systems.vision.camera_model import Cameras
from tests.systems.vision.rigs import CAMERAS

TRUE = CAMERAS.subset([4])
SIZE = 3071, 1983


def seen_points(rng: np.random.Generator, count: int, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Points all over the image, 2 to 5 m away, and their pixels."""
    pixels = rng.uniform([0, 0], SIZE, (1, count, 2))
    points = TRUE.p_WC[0] + rng.uniform(2.0, 5.0, (count, 1)) * TRUE.directions(pixels)[0]
    return points, pixels[0] + sigma * rng.standard_normal((count, 2))


def lens(camera: Cameras) -> np.ndarray:
    return np.concatenate([camera.focal[0], camera.center[0], camera.radial[0], camera.tangential[0]])


def test_without_noise_the_camera_is_found():
    found = calibrate_from_points(*seen_points(np.random.default_rng(0), 60, 0.0))
    assert found.rms < 1e-6
    np.testing.assert_allclose(lens(found.camera), lens(TRUE), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(found.camera.p_WC, TRUE.p_WC, atol=1e-7)
    np.testing.assert_allclose(found.camera.R_WC, TRUE.R_WC, atol=1e-7)


def test_opencv_finds_the_same_camera():
    """Both minimise the same sum of squares over the same parameters; float32 is what OpenCV works with."""
    points, pixels = seen_points(np.random.default_rng(1), 200, 0.1)
    ours = calibrate_from_points(points, pixels)
    start = np.array([[3000.0, 0.0, 1500.0], [0.0, 3000.0, 1000.0], [0.0, 0.0, 1.0]])
    rms, K, bend, _, _ = cv2.calibrateCamera(
        [points.astype(np.float32)], [pixels.astype(np.float32)], SIZE, start, np.zeros(5),
        flags=cv2.CALIB_USE_INTRINSIC_GUESS,
    )  # fmt: skip
    assert ours.rms == pytest.approx(rms, rel=1e-3)
    k1, k2, p1, p2, k3 = bend.ravel()
    theirs = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], k1, k2, k3, p1, p2])
    sigmas = np.sqrt(np.diag(ours.covariance)[:NUM_LENS])
    assert np.abs((lens(ours.camera) - theirs) / sigmas).max() < 0.05


def test_the_truth_is_as_far_away_as_the_standard_deviations_say():
    """Fifty calibrations with nine parameters: the spread of 450 ratios is one to 7 %, four times that."""
    ratios = []
    for seed in range(50):
        found = calibrate_from_points(*seen_points(np.random.default_rng(seed), 80, 0.1))
        sigmas = np.sqrt(np.diag(found.covariance)[:NUM_LENS])
        ratios.append((lens(found.camera) - lens(TRUE)) / sigmas)
    # The parameters of a lens depend on each other, so there are fewer than 450 independent ones.
    assert np.std(ratios) == pytest.approx(1.0, abs=0.28)


def test_points_that_are_not_seen_are_left_out():
    points, pixels = seen_points(np.random.default_rng(2), 60, 0.1)
    some = pixels.copy()
    some[::3] = np.nan
    keep = ~np.isnan(some[:, 0])
    with_gaps = calibrate_from_points(points, some)
    without = calibrate_from_points(points[keep], pixels[keep])
    np.testing.assert_array_equal(lens(with_gaps.camera), lens(without.camera))
    assert np.isnan(with_gaps.residual[::3]).all()
    assert with_gaps.rms == pytest.approx(without.rms)


def test_refuses_too_few_points():
    with pytest.raises(UndeterminedError, match="at least 8 known points, got 7"):
        calibrate_from_points(*seen_points(np.random.default_rng(3), 7, 0.0))
