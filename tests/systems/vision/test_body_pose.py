"""The pose of a body from the places of its markers: exact, weighted, with its covariance, or refused."""

import numpy as np
import pytest

from robots.metrology.least_squares import UndeterminedError
from robots.metrology.point_registration import register_points
from robots.pose import pose_error
from systems.vision.body_pose import body_pose, fit_poses
from tests.systems.vision.rigs import BODY, placed, random_pose

RNG = np.random.default_rng(0)
EQUAL = np.broadcast_to(1e-8 * np.eye(3), (len(BODY), 3, 3))


def test_without_noise_the_pose_is_exact():
    for _ in range(20):
        X = random_pose(RNG)
        fit = body_pose(BODY.p_E, placed(X, BODY.p_E), EQUAL)
        np.testing.assert_allclose(fit.X_WE, X, atol=1e-13)
        assert fit.rms < 1e-13


def test_weights_and_residuals_are_those_of_the_registration_of_calibration():
    X = random_pose(RNG)
    sigma = RNG.uniform(1e-4, 1e-3, len(BODY))
    seen = placed(X, BODY.p_E) + sigma[:, None] * RNG.standard_normal((len(BODY), 3))
    fit = body_pose(BODY.p_E, seen, sigma[:, None, None] ** 2 * np.eye(3))
    other = register_points(BODY.p_E, seen, 1.0 / sigma**2)
    np.testing.assert_allclose(fit.X_WE, other.X_DK.GetAsMatrix4(), atol=1e-10)
    np.testing.assert_allclose(fit.residual, other.residual, atol=1e-10)


@pytest.mark.slow
def test_the_covariance_is_that_of_many_measurements():
    """Points of very different quality; 3000 measurements know a standard deviation to 1.3 %, 4 sigma."""
    n, X = 3000, random_pose(RNG)
    roots = RNG.uniform(-3e-4, 3e-4, (len(BODY), 3, 3))
    covariance = roots @ roots.swapaxes(1, 2)
    error = []
    for noise in RNG.standard_normal((n, len(BODY), 3, 1)):
        seen = placed(X, BODY.p_E) + (roots @ noise)[..., 0]
        error.append(pose_error(body_pose(BODY.p_E, seen, covariance).X_WE, X))
    expected = body_pose(BODY.p_E, placed(X, BODY.p_E), covariance).covariance
    whitened = np.linalg.solve(np.linalg.cholesky(expected), np.array(error).T)
    np.testing.assert_allclose(whitened.std(axis=1), 1.0, rtol=4.0 / np.sqrt(2 * n))
    np.testing.assert_allclose(np.corrcoef(whitened), np.eye(6), atol=4.0 / np.sqrt(n))


def test_a_mirror_image_is_not_taken_for_a_rotation():
    R, _ = fit_poses(BODY.p_E[None], (BODY.p_E * [1.0, 1.0, -1.0])[None], np.ones((1, len(BODY))))
    assert np.linalg.det(R[0]) == pytest.approx(1.0)


def test_many_poses_at_once_are_those_one_by_one():
    poses = np.array([random_pose(RNG) for _ in range(7)])
    p_W = np.array([placed(X, BODY.p_E) for X in poses]) + 1e-3 * RNG.standard_normal((7, len(BODY), 3))
    R, p = fit_poses(np.broadcast_to(BODY.p_E, p_W.shape), p_W, np.ones(p_W.shape[:2]))
    for i in range(7):
        X = body_pose(BODY.p_E, p_W[i], EQUAL).X_WE
        np.testing.assert_allclose(R[i], X[:3, :3], atol=1e-12)
        np.testing.assert_allclose(p[i], X[:3, 3], atol=1e-12)


def test_refuses_two_markers_and_markers_on_a_line():
    with pytest.raises(UndeterminedError, match="at least 3 markers, got 2"):
        body_pose(BODY.p_E[:2], BODY.p_E[:2], EQUAL[:2])
    line = np.linspace(0.0, 1.0, 4)[:, None] * [0.1, 0.2, 0.3]
    with pytest.raises(UndeterminedError, match="the 4 markers are collinear"):
        body_pose(line, line, EQUAL[:4])
