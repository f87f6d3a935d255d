"""The camera model: OpenCV's projection for many cameras at once, its inverse, and its derivative."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from systems.vision.camera_model import Cameras
from tests.systems.vision.rigs import random_cameras

RNG = np.random.default_rng(0)
CAMERAS = random_cameras(RNG)
POINTS = RNG.uniform(-0.4, 0.4, (50, 3))


def opencv_lens(cameras: Cameras, i: int) -> np.ndarray:
    k1, k2, k3 = cameras.radial[i]
    return np.array([k1, k2, *cameras.tangential[i], k3])


def test_a_point_on_the_axis_is_at_the_principal_point_and_a_small_offset_appears_times_focal_over_depth():
    camera = CAMERAS.subset([0])
    forward, right = camera.R_WC[0, :, 2], camera.R_WC[0, :, 0]
    p = camera.p_WC[0] + 2.0 * forward
    on_axis, beside = camera.project(np.array([p, p + 1e-6 * right]))[0]
    np.testing.assert_allclose(on_axis, camera.center[0], atol=1e-9)
    np.testing.assert_allclose(beside - on_axis, [1e-6 * camera.focal[0, 0] / 2.0, 0.0], atol=1e-8)


def test_projects_as_opencv_does():
    pixels = CAMERAS.project(POINTS)
    for i in range(len(CAMERAS)):
        turn = cv2.Rodrigues(CAMERAS.R_CW[i])[0]
        theirs = cv2.projectPoints(
            POINTS, turn, CAMERAS.p_CW[i], CAMERAS.intrinsics[i], opencv_lens(CAMERAS, i)
        )
        np.testing.assert_allclose(pixels[i], theirs[0][:, 0], atol=1e-8)  # pixels are thousands


def test_undistorts_as_opencv_does_and_better():
    pixels = CAMERAS.project(POINTS)
    p_C = (POINTS - CAMERAS.p_WC[:, None]) @ CAMERAS.R_WC
    truth = p_C[..., :2] / p_C[..., 2:]
    ours = CAMERAS.normalized(pixels)
    np.testing.assert_allclose(ours, truth, atol=1e-12)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-12)
    for i in range(len(CAMERAS)):
        K, lens = CAMERAS.intrinsics[i], opencv_lens(CAMERAS, i)
        theirs = cv2.undistortPointsIter(pixels[i][:, None], K, lens, np.eye(3), np.eye(3), criteria)
        np.testing.assert_allclose(ours[i], theirs[:, 0], atol=1e-9)


def test_undistorted_pixels_are_those_of_a_camera_without_a_lens():
    ideal = replace(CAMERAS, radial=np.zeros((4, 3)), tangential=np.zeros((4, 2)))
    undistorted = CAMERAS.undistort(CAMERAS.project(POINTS))
    np.testing.assert_allclose(undistorted, ideal.project(POINTS), atol=1e-8)
    homogeneous = np.hstack([POINTS, np.ones((len(POINTS), 1))]) @ CAMERAS.projections.swapaxes(1, 2)
    np.testing.assert_allclose(undistorted, homogeneous[..., :2] / homogeneous[..., 2:], atol=1e-8)


def test_rays_of_pixels_lead_through_the_points():
    directions = CAMERAS.directions(CAMERAS.project(POINTS))
    to_points = POINTS - CAMERAS.p_WC[:, None]
    to_points /= np.linalg.norm(to_points, axis=-1, keepdims=True)
    np.testing.assert_allclose(directions, to_points, atol=1e-12)


def test_the_jacobian_is_the_derivative_of_the_projection():
    """Central differences with h = 1e-6 m are good to h^2 f''' plus rounding over h: about 1e-5 px/m."""
    _, J = CAMERAS.project_with_jacobian(POINTS)
    h = 1e-6
    for axis in range(3):
        step = h * np.eye(3)[axis]
        slope = (CAMERAS.project(POINTS + step) - CAMERAS.project(POINTS - step)) / (2.0 * h)
        np.testing.assert_allclose(J[..., axis], slope, atol=1e-4)


def test_keeps_the_shape_of_a_batch():
    p = POINTS[:6].reshape(2, 3, 3)
    pixels, J = CAMERAS.project_with_jacobian(p)
    assert pixels.shape == (4, 2, 3, 2)
    assert J.shape == (4, 2, 3, 2, 3)
    assert CAMERAS.depth(p).shape == (4, 2, 3)
    np.testing.assert_array_equal(pixels.reshape(4, 6, 2), CAMERAS.project(POINTS[:6]))
    np.testing.assert_allclose(
        CAMERAS.undistort(pixels).reshape(4, 6, 2), CAMERAS.undistort(pixels.reshape(4, 6, 2))
    )


def test_what_is_behind_a_camera_or_beyond_the_fold_of_its_lens_has_no_pixel_and_no_ray():
    camera = replace(CAMERAS.subset([0]), radial=np.array([[-0.3, 0.0, 0.0]]), tangential=np.zeros((1, 2)))
    behind = camera.p_WC - camera.R_WC[:, :, 2]
    assert np.isnan(camera.project(behind)).all()
    # x (1 - 0.3 x^2) is largest at x = 1.054, where it is 0.703.
    beyond = camera.center + camera.focal * [0.8, 0.0]
    assert np.isnan(camera.normalized(beyond[:, None])).all()
    assert np.isnan(camera.normalized(np.full((1, 1, 2), np.nan))).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"focal": np.zeros((4, 2))}, "focal lengths must be positive, got 0"),
        ({"center": np.full((4, 2), np.nan)}, "center must be 4 x 2 finite"),
        ({"radial": np.zeros((4, 2))}, "radial must be 4 x 3"),
        ({"R_WC": np.zeros((4, 3, 3))}, "must be 4 rotation matrices"),
        ({"R_WC": -CAMERAS.R_WC}, "left-handed"),
    ],
)
def test_refuses_what_is_no_camera(change: dict, message: str):
    with pytest.raises(ValueError, match=f"cameras: .*{message}"):
        replace(CAMERAS, **change)
