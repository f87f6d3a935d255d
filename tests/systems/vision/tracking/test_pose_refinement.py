"""The most likely pose: exact without noise, and at the Cramer-Rao bound with it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.metrology.least_squares import UndeterminedError
from robots.pose import pose_error
from systems.vision.tracking.pose_refinement import linearize, moved, refine_pose, shared
from tests.systems.vision.rigs import BODY, CAMERAS, placed, random_pose

RNG = np.random.default_rng(0)


def test_without_noise_the_pose_is_exact_from_centimetres_and_degrees_away():
    for _ in range(20):
        X = random_pose(RNG)
        start = moved(X, np.concatenate([RNG.uniform(-0.1, 0.1, 3), RNG.uniform(-0.02, 0.02, 3)]))
        fit = refine_pose(CAMERAS, BODY.p_E, CAMERAS.project(placed(X, BODY.p_E)), start)
        np.testing.assert_allclose(fit.X_WE, X, atol=1e-11)
        assert fit.sigma < 1e-8


def test_pixels_move_with_the_pose_as_linearised():
    X, h = random_pose(RNG), 1e-6
    _, J = linearize(CAMERAS, BODY.p_E, X)
    for i in range(6):
        step = h * np.eye(6)[i]
        ahead, behind = (linearize(CAMERAS, BODY.p_E, moved(X, s * step))[0] for s in (1, -1))
        np.testing.assert_allclose(J[..., i], (ahead - behind) / (2.0 * h), atol=1e-4)  # rounding over h


def test_the_spread_is_the_predicted_covariance_and_the_cramer_rao_bound():
    """All cameras, 0.1 px: 2000 measurements know a standard deviation to 1.6 %; four times that is allowed.

    The bound sigma^2 (J^T J)^-1 is taken from derivatives of the projection by finite differences.
    """
    n, sigma, X, h = 2000, 0.1, random_pose(RNG), 1e-6
    pixels = CAMERAS.project(placed(X, BODY.p_E))
    columns = [
        (CAMERAS.project(placed(moved(X, h * axis), BODY.p_E)) - pixels).ravel() / h for axis in np.eye(6)
    ]
    J = np.array(columns).T
    bound = sigma**2 * np.linalg.inv(J.T @ J)
    fits = [
        refine_pose(CAMERAS, BODY.p_E, pixels + sigma * noise, X)
        for noise in RNG.standard_normal((n, *pixels.shape))
    ]
    error = np.array([pose_error(fit.X_WE, X) for fit in fits])
    allowed = 4.0 / np.sqrt(2 * n)
    np.testing.assert_allclose(error.std(axis=0), np.sqrt(np.diag(bound)), rtol=allowed)
    predicted = sigma**2 * np.mean([fit.cofactor for fit in fits], axis=0)
    whitened = np.linalg.solve(np.linalg.cholesky(predicted), error.T)
    np.testing.assert_allclose(whitened.std(axis=1), 1.0, rtol=allowed)
    np.testing.assert_allclose(np.corrcoef(whitened), np.eye(6), atol=4.0 / np.sqrt(n))
    assert np.mean([fit.sigma for fit in fits]) == pytest.approx(sigma, rel=0.01)


def test_blobs_that_two_markers_share_say_what_their_middle_says():
    """With shared blobs alone, 0.3 of one marker and 0.7 of the next, the pose is exact all the same."""
    X, m = random_pose(RNG), len(BODY)
    share = np.tile(0.3 * np.eye(m) + 0.7 * np.roll(np.eye(m), 1, axis=1), (len(CAMERAS), 1, 1))
    share[:, -1] = 0.0  # a row without a blob
    true = CAMERAS.project(placed(X, BODY.p_E))
    middles = shared(true, share)
    np.testing.assert_allclose(middles[:, 0], 0.3 * true[:, 0] + 0.7 * true[:, 1])
    assert np.isnan(middles[:, -1]).all()
    pixels = np.concatenate([np.full_like(true, np.nan), middles], axis=1)
    start = moved(X, np.full(6, 0.01))
    fit = refine_pose(CAMERAS, BODY.p_E, pixels, start, share)
    np.testing.assert_allclose(fit.X_WE, X, atol=1e-11)
    assert fit.count == len(CAMERAS) * (m - 1)


def test_a_marker_behind_a_camera_has_no_share_in_its_blobs():
    of_markers = np.array([[[1.0, 2.0], [np.nan, np.nan], [3.0, 4.0]]])
    np.testing.assert_allclose(shared(of_markers, np.array([[[0.5, 0.0, 0.5]]])), [[[2.0, 3.0]]])


def test_a_motion_turns_about_the_origin_of_the_tool_and_shifts_in_the_world():
    X = random_pose(RNG)
    for motion in RNG.uniform(-2.0, 2.0, (10, 6)):
        after = moved(X, motion)
        turn = Rotation.from_rotvec(motion[:3]).as_matrix()
        np.testing.assert_allclose(after[:3, :3], turn @ X[:3, :3], atol=1e-14)
        np.testing.assert_allclose(after[:3, 3], X[:3, 3] + motion[3:], atol=1e-15)
    np.testing.assert_allclose(moved(X, np.zeros(6)), X, atol=1e-15)


def test_rotations_stay_orthonormal_over_many_frames():
    """Rounding of 1e-16 a step would grow like a random walk; it is taken out as it comes."""
    X = np.eye(4)
    for motion in RNG.uniform(-0.01, 0.01, (20_000, 6)):
        X = moved(X, motion)
    np.testing.assert_allclose(X[:3, :3].T @ X[:3, :3], np.eye(3), atol=1e-15)


def test_refuses_too_few_pixels_and_markers_in_a_point_or_on_a_line():
    X = random_pose(RNG)
    pixels = np.full((len(CAMERAS), len(BODY), 2), np.nan)
    pixels[0, :2] = CAMERAS.project(placed(X, BODY.p_E))[0, :2]
    with pytest.raises(UndeterminedError, match="at least three pixels, got 2"):
        refine_pose(CAMERAS, BODY.p_E, pixels, X)
    line = np.linspace(-0.1, 0.1, len(BODY))[:, None] * [1.0, 2.0, 3.0]
    for markers in (np.zeros((len(BODY), 3)), line):
        with pytest.raises(UndeterminedError, match="leave a direction of the pose free"):
            refine_pose(CAMERAS, markers, CAMERAS.project(placed(X, markers)), X)
