"""Depth of field against the lens equation 1/f = 1/g + 1/b, and in the limit of a far focus."""

import numpy as np
import pytest

from systems.vision.depth_of_field import DepthOfField

LENS = {"focal_length": 16e-3, "f_number": 5.6, "pixel_pitch": 3.45e-6}


def image_distance(focal_length: float, distance: np.ndarray) -> np.ndarray:
    return focal_length * distance / (distance - focal_length)


@pytest.mark.parametrize("focus", [0.5, 2.0, 4.0, 8.0])
def test_the_circle_is_the_cone_of_light_cut_by_the_sensor(focus):
    """The rays through the rim of the aperture meet behind or before the sensor: similar triangles."""
    lens = DepthOfField(focus_distance=focus, **LENS)
    distance = np.array([0.3, 1.0, 3.0, 20.0])
    meet, sensor = image_distance(lens.focal_length, distance), image_distance(lens.focal_length, focus)
    aperture = lens.focal_length / lens.f_number
    np.testing.assert_allclose(lens.blur_circle(distance), aperture * np.abs(meet - sensor) / meet, rtol=1e-9)


@pytest.mark.parametrize("focus", [0.5, 2.0, 4.0, 8.0])
def test_near_and_far_point_are_blurred_by_exactly_a_pixel(focus):
    lens = DepthOfField(focus_distance=focus, **LENS)
    np.testing.assert_allclose(lens.blur_circle(np.array([lens.near, lens.far])), lens.pixel_pitch, rtol=1e-9)
    assert lens.near < focus < lens.far


def test_focused_at_the_hyperfocal_distance_everything_beyond_half_of_it_is_sharp():
    d_h = DepthOfField(focus_distance=1.0, **LENS).hyperfocal
    lens = DepthOfField(focus_distance=d_h, **LENS)
    assert lens.near == pytest.approx(d_h / 2.0, rel=1e-12)
    assert lens.far == np.inf
    assert lens.blur_circle(np.array(1e9)) == pytest.approx(lens.pixel_pitch, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"f_number": 0.0}, "f_number must be positive, got 0.0"),
        ({"focus_distance": 0.01}, "beyond the focal length of 0.016 m, got 0.01 m"),
    ],
)
def test_refuses_lenses_that_do_not_exist(change, says):
    with pytest.raises(ValueError, match=says):
        DepthOfField(**{"focus_distance": 2.0, **LENS, **change})
