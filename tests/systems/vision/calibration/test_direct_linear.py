"""The direct linear transformation: exact without noise and lens, and refusals of what determines nothing."""

from dataclasses import replace

import numpy as np
import pytest

from robots.metrology.least_squares import UndeterminedError
from systems.vision.calibration.direct_linear import camera_from_projection, direct_linear
from tests.systems.vision.rigs import random_cameras

RNG = np.random.default_rng(0)
CAMERAS = random_cameras(RNG)
PINHOLES = replace(CAMERAS, radial=0.0 * CAMERAS.radial, tangential=0.0 * CAMERAS.tangential)
POINTS = RNG.uniform(-0.3, 0.3, (12, 3))


@pytest.mark.parametrize("count", [6, 12])
def test_projection_and_camera_are_found_from_their_pixels(count: int):
    for i, pixels in enumerate(PINHOLES.project(POINTS[:count])):
        P = direct_linear(POINTS[:count], pixels)
        expected = PINHOLES.projections[i]
        np.testing.assert_allclose(P / P[2, 3], expected / expected[2, 3], rtol=1e-6, atol=1e-6)
        found = camera_from_projection(P, POINTS)
        for name in ("focal", "center", "R_WC", "p_WC"):
            true = getattr(PINHOLES, name)[i]
            np.testing.assert_allclose(getattr(found, name)[0], true, rtol=1e-6, atol=1e-6, err_msg=name)


def test_sign_and_scale_of_the_projection_do_not_matter():
    P = PINHOLES.projections[0]
    for factor in (1.0, -3.0, 1e-4):
        found = camera_from_projection(factor * P, POINTS)
        np.testing.assert_allclose(found.p_WC[0], PINHOLES.p_WC[0], atol=1e-9)
        np.testing.assert_allclose(found.R_WC[0], PINHOLES.R_WC[0], atol=1e-9)


def test_the_unit_of_the_points_does_not_matter():
    pixels = PINHOLES.project(POINTS)[0] + RNG.normal(0.0, 0.5, (len(POINTS), 2))
    metres, millimetres = direct_linear(POINTS, pixels), direct_linear(1e3 * POINTS, pixels)
    pairs = ((POINTS, metres), (1e3 * POINTS, millimetres))
    seen = [np.column_stack([points, np.ones(12)]) @ P.T for points, P in pairs]
    np.testing.assert_allclose(seen[0] / seen[0][:, 2:], seen[1] / seen[1][:, 2:], rtol=1e-9)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (POINTS[:5], "at least 6 known points, got 5"),
        (POINTS * [1.0, 1.0, 0.0], "the 12 known points lie in a plane"),
    ],
)
def test_refuses_what_does_not_determine_a_camera(points: np.ndarray, message: str):
    with pytest.raises(UndeterminedError, match=message):
        direct_linear(points, PINHOLES.project(points)[0])


def test_refuses_a_mirror_image():
    pixels = PINHOLES.project(POINTS)[0] * [-1.0, 1.0]
    with pytest.raises(UndeterminedError, match="mirror image"):
        camera_from_projection(direct_linear(POINTS, pixels), POINTS)
