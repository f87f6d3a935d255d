"""All fifteen parameters of a camera: derivatives are those of finite differences."""

import numpy as np
import pytest

from systems.vision.calibration.camera_parameters import (
    NAMES,
    NUM,
    change_between,
    moved_cameras,
    project_with_parameters,
)
from tests.systems.vision.rigs import random_cameras

RNG = np.random.default_rng(0)
CAMERAS = random_cameras(RNG)
POINTS = RNG.uniform(-0.3, 0.3, (6, 3))


@pytest.mark.parametrize("index", range(NUM), ids=NAMES)
def test_pixels_change_with_each_parameter_as_linearised(index: int):
    _, J, _ = project_with_parameters(CAMERAS, POINTS)
    h = 1e-6
    step = np.zeros((len(CAMERAS), NUM))
    step[:, index] = h
    ahead, behind = (moved_cameras(CAMERAS, sign * step).project(POINTS) for sign in (1.0, -1.0))
    numeric = (ahead - behind) / (2.0 * h)
    # Rounding of pixels in the thousands over h is 5e-7.
    np.testing.assert_allclose(J[..., index], numeric, atol=2e-6 + 1e-6 * np.abs(numeric).max())


def test_pixels_and_their_derivatives_by_the_points_are_those_of_the_camera():
    pixels, _, J_point = project_with_parameters(CAMERAS, POINTS)
    expected, J = CAMERAS.project_with_jacobian(POINTS)
    np.testing.assert_allclose(pixels, expected, atol=1e-9)
    np.testing.assert_allclose(J_point, J, atol=1e-8)


def test_no_change_changes_nothing_and_a_turn_leaves_a_rotation():
    same = moved_cameras(CAMERAS, np.zeros((4, NUM)))
    np.testing.assert_allclose(same.p_WC, CAMERAS.p_WC, atol=1e-12)
    turned = moved_cameras(CAMERAS, np.full((4, NUM), 0.3))
    np.testing.assert_allclose(turned.R_WC @ turned.R_CW, np.tile(np.eye(3), (4, 1, 1)), atol=1e-12)


def test_a_change_is_found_again():
    change = RNG.uniform(-0.5, 0.5, (4, NUM))
    np.testing.assert_allclose(change_between(CAMERAS, moved_cameras(CAMERAS, change)), change, atol=1e-12)


def test_points_behind_a_camera_have_no_pixels():
    behind = CAMERAS.p_WC[0] - 0.5 * CAMERAS.R_WC[0, :, 2]
    pixels, J, _ = project_with_parameters(CAMERAS, behind[None])
    assert np.isnan(pixels[0]).all()
    assert np.isnan(J[0, ..., -1]).all()
