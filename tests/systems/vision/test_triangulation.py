"""Triangulation: exact without noise, as good as its covariance says with it, silent where none is."""

import cv2
import numpy as np
from scipy.optimize import least_squares

from systems.vision.triangulation import triangulate, triangulate_linear, triangulate_reweighted
from tests.systems.vision.rigs import CAMERAS

RNG = np.random.default_rng(0)
POINTS = np.array([0.45, 0.0, 0.4]) + RNG.uniform(-0.4, 0.4, (12, 3))
PIXELS = CAMERAS.project(POINTS)


def test_without_noise_the_points_are_exact_whoever_sees_them():
    found = triangulate(CAMERAS, PIXELS, 0.1)
    np.testing.assert_allclose(found.p_W, POINTS, atol=1e-11)
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-8)
    partly = PIXELS.copy()
    partly[RNG.random(partly.shape[:2]) < 0.5] = np.nan
    partly[:2] = PIXELS[:2]
    np.testing.assert_allclose(triangulate(CAMERAS, partly, 0.1).p_W, POINTS, atol=1e-9)


def test_two_cameras_give_what_opencv_gives():
    """Both solve eq. (3.12) of Probst (2024) by singular values, but pixels with noise in other units."""
    noisy = CAMERAS.undistort(PIXELS + 0.1 * RNG.standard_normal(PIXELS.shape))[:2]
    P = CAMERAS.projections
    theirs = cv2.triangulatePoints(P[0], P[1], noisy[0].T, noisy[1].T)
    linear = triangulate_linear(P[:2], noisy)
    np.testing.assert_allclose(linear, (theirs[:3] / theirs[3]).T, atol=1e-9)


def test_reweighting_finds_the_least_squares_of_the_images_to_first_order():
    """They differ by the change of depth over the noise of a pixel, squared: far below a thousandth of it."""
    sigma = 0.1
    ideal = CAMERAS.undistort(PIXELS + sigma * RNG.standard_normal(PIXELS.shape))
    P = CAMERAS.projections

    def error(p_W: np.ndarray, k: int) -> np.ndarray:
        seen = P @ np.append(p_W, 1.0)
        return (seen[:, :2] / seen[:, 2:] - ideal[:, k]).ravel()

    found = triangulate_reweighted(P, ideal)
    linear = triangulate_linear(P, ideal)
    for k in range(len(POINTS)):
        best = least_squares(error, POINTS[k], args=(k,), xtol=1e-14, ftol=1e-14)
        np.testing.assert_allclose(found[k], best.x, atol=1e-7)
        assert np.sum(error(found[k], k) ** 2) <= np.sum(error(linear[k], k) ** 2) + 1e-9


def test_the_covariance_is_that_of_many_measurements():
    """2000 measurements know a standard deviation to 1.6 %; four times that is allowed."""
    n, sigma = 2000, 0.1
    pixels = np.repeat(PIXELS[:, :1], n, axis=1) + sigma * RNG.standard_normal((len(CAMERAS), n, 2))
    found = triangulate(CAMERAS, pixels, sigma)
    error = found.p_W - POINTS[0]
    whitened = np.linalg.solve(np.linalg.cholesky(found.covariance[0]), error.T)
    np.testing.assert_allclose(whitened.std(axis=1), 1.0, rtol=4.0 / np.sqrt(2 * n))
    np.testing.assert_allclose(np.corrcoef(whitened), np.eye(3), atol=4.0 / np.sqrt(n))


def test_fewer_than_two_cameras_or_parallel_rays_give_no_point():
    pixels = PIXELS[:, :3].copy()
    pixels[1:, 0] = np.nan  # one camera
    pixels[:, 1] = np.nan  # none
    found = triangulate(CAMERAS, pixels, 0.1)
    np.testing.assert_array_equal(np.isnan(found.p_W).all(1), [True, True, False])
    np.testing.assert_array_equal(np.isnan(found.residual), [True, True, False])
    twice = CAMERAS.subset([0, 0])  # two cameras in one place
    assert np.isnan(triangulate(twice, PIXELS[[0, 0]], 0.1).p_W).all()
