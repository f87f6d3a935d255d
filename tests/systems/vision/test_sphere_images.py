"""Spheres appear as ellipses: the outline touches the sphere, and its centre is not that of the sphere."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from systems.vision.sphere_images import sphere_centers, sphere_images
from tests.systems.vision.rigs import BODY, CAMERAS, placed, random_cameras, random_pose

RNG = np.random.default_rng(0)
RADIUS = 0.008


def outline(center: np.ndarray, shape: np.ndarray, count: int = 60) -> np.ndarray:
    """Points on an ellipse, (count, 2)."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return center + np.stack([np.cos(angle), np.sin(angle)], -1) @ np.linalg.cholesky(shape).T


def test_rays_through_the_outline_touch_the_sphere():
    """Without a lens that bends, exactly: their distance from the centre is the radius."""
    cameras = random_cameras(RNG)
    pinholes = replace(cameras, radial=0.0 * cameras.radial, tangential=0.0 * cameras.tangential)
    p_W, radius = RNG.uniform(-0.3, 0.3, (5, 3)), 0.1
    ellipses = sphere_images(pinholes, p_W, radius)
    for i in range(len(pinholes)):
        for k in range(len(p_W)):
            pixels = np.tile(outline(ellipses.center[i, k], ellipses.shape[i, k]), (len(pinholes), 1, 1))
            rays = pinholes.directions(pixels)[i]
            distance = np.linalg.norm(np.cross(p_W[k] - pinholes.p_WC[i], rays), axis=1)
            np.testing.assert_allclose(distance, radius, rtol=1e-9)


def test_the_mean_of_what_a_lens_shows_is_the_centre_of_the_ellipse():
    """The sphere is painted with random rays through its cross section; a lens bends them one by one.

    40,000 of them know their mean to 0.5 % of the radius of 4 to 12 px.
    """
    p_W = placed(random_pose(RNG), BODY.p_E)[:2]
    ellipses = sphere_images(CAMERAS, p_W, RADIUS)
    xy = CAMERAS.normalized(ellipses.center)
    for i in range(len(CAMERAS)):
        spread = np.linalg.inv(CAMERAS.through_lens(xy)[1][i, 0])
        shape = spread @ ellipses.shape[i, 0] @ spread.T
        disc = np.sqrt(RNG.uniform(size=(40_000, 1))) * outline(np.zeros(2), np.eye(2), 40_000)
        seen = xy[i, 0] + disc @ np.linalg.cholesky(shape).T
        pixels = CAMERAS.subset([i]).through_lens(seen[None])[0][0]
        np.testing.assert_allclose(pixels.mean(0), ellipses.center[i, 0], atol=0.06)
        covariance = 4.0 * np.cov(pixels.T)  # a disc of radius one has the variance 1/4
        np.testing.assert_allclose(covariance, ellipses.shape[i, 0], atol=0.03 * np.trace(covariance))


def test_the_ellipse_lies_further_out_than_the_centre_and_its_area_says_how_far():
    """The shift is thousandths of a px in this cell; nine tenths and more of it are taken away."""
    shifts, left = [], []
    for _ in range(50):
        p_W = placed(random_pose(RNG, 0.3), BODY.p_E)
        ellipses, true = sphere_images(CAMERAS, p_W, RADIUS), CAMERAS.project(p_W)
        areas = np.pi * np.sqrt(np.linalg.det(ellipses.shape))
        corrected = sphere_centers(CAMERAS, ellipses.center, areas)
        shift = ellipses.center - true
        assert np.all(np.sum(shift * (true - CAMERAS.center[:, None]), -1) > 0.0)
        shifts.append(np.abs(shift).max())
        left.append(np.abs(corrected - true).max())
    assert max(shifts) > 3e-3
    assert max(left) < 0.1 * max(shifts)


def test_on_the_axis_it_is_a_circle_and_behind_the_camera_nothing():
    cameras = CAMERAS.subset([0])
    axis = cameras.R_WC[0, :, 2]
    ellipses = sphere_images(cameras, cameras.p_WC[0] + np.array([[3.0], [-3.0]]) * axis, 0.1)
    scale = 3000.0**2 * 0.1**2 / (3.0**2 - 0.1**2)
    np.testing.assert_allclose(ellipses.center[0, 0], cameras.center[0], atol=1e-9)
    np.testing.assert_allclose(ellipses.shape[0, 0], scale * np.eye(2), rtol=1e-9, atol=1e-9)
    assert np.isnan(ellipses.center[0, 1]).all()


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_turning_camera_and_sphere_together_changes_nothing(turn: float):
    R = Rotation.from_rotvec([0.0, turn, 0.3 * turn]).as_matrix()
    turned = replace(CAMERAS, R_WC=R @ CAMERAS.R_WC, p_WC=CAMERAS.p_WC @ R.T)
    p_W = placed(random_pose(np.random.default_rng(1)), BODY.p_E)
    one, other = sphere_images(CAMERAS, p_W, RADIUS), sphere_images(turned, p_W @ R.T, RADIUS)
    np.testing.assert_allclose(one.center, other.center, atol=1e-8)
    np.testing.assert_allclose(one.shape, other.shape, atol=1e-8)
