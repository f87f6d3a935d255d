"""Pictures: how much light is in them and where, what motion, noise, windows and the arm do to them."""

import numpy as np
import pytest

from robots.kinematics.arm_capsules import Capsules
from systems.cell.imaging.images import ImageConfig, ImageSource
from systems.vision.marker_body import DetectionBody
from systems.vision.rendering import FULL_SCALE, Picture
from systems.vision.sphere_images import sphere_images
from tests.systems.vision.rigs import BODY, CAMERAS, CELL, placed, random_pose

DARK = {"background": 0.0, "noise_sigma": 0.0}
STILL = np.zeros(6)
ONE = DetectionBody(markers_mm=np.zeros((1, 3)))
X = random_pose(np.random.default_rng(3), 0.1)
KEY = np.array([0.3, -1.2])


def source(**config) -> ImageSource:
    return ImageSource(CAMERAS, CELL.windows, BODY, ImageConfig(**config))


def expose(images: ImageSource, V_WE: np.ndarray = STILL, key: np.ndarray = KEY, **kwargs) -> list[Picture]:
    return images.expose(X, V_WE, key, images.windows(X), **kwargs)


def moments(picture: Picture) -> tuple[float, np.ndarray, np.ndarray]:
    """Sum of light in full scales, its mean place and covariance in px."""
    light = picture.pixels / FULL_SCALE
    v, u = np.indices(light.shape)
    places = np.stack([u.ravel(), v.ravel()], -1) + picture.corner
    middle = light.ravel() @ places / light.sum()
    offset = places - middle
    return float(light.sum()), middle, (light.ravel()[:, None] * offset).T @ offset / light.sum()


def test_the_light_in_a_picture_is_the_area_of_the_ellipse_and_its_mean_the_centre():
    """What is dimmer than half a step of eight bits is lost: up to two percent of the light."""
    p_W = X[None, :3, 3]
    spheres = sphere_images(CAMERAS, p_W, 0.5 * BODY.diameter)
    area = np.pi * np.sqrt(np.linalg.det(spheres.shape[:, 0]))
    for i, picture in enumerate(expose(ImageSource(CAMERAS, CELL.windows, ONE, ImageConfig(**DARK)))):
        light, middle, spread = moments(picture)
        assert light == pytest.approx(0.8 * area[i], rel=0.02)
        np.testing.assert_allclose(middle, spheres.center[i, 0], atol=0.01)
        blur = 0.7**2 + 1.0 / 12.0
        np.testing.assert_allclose(spread, spheres.shape[i, 0] / 4.0 + blur * np.eye(2), rtol=0.1, atol=0.3)


def test_out_of_focus_a_marker_is_spread_by_its_blur_circle():
    """A disc of diameter b has the variance b^2/16 along an axis; straight edges add a little light."""
    lens = {"f_number": 5.0, "focus_distance": 2.0, **DARK}
    sharp, soft = (
        expose(ImageSource(CAMERAS, CELL.windows, ONE, ImageConfig(**config))) for config in (DARK, lens)
    )
    distance = CAMERAS.depth(X[:3, 3])
    f = CAMERAS.focal.mean(1) * 5.5e-6
    circle = f**2 / 5.0 * np.abs(distance - 2.0) / (distance * (2.0 - f)) / 5.5e-6  # px
    assert circle.min() > 1.5
    for before, after, b in zip(sharp, soft, circle, strict=True):
        (light, middle, spread), (light_too, middle_too, wider) = moments(before), moments(after)
        assert light_too == pytest.approx(light, rel=0.06)
        np.testing.assert_allclose(middle_too, middle, atol=0.03)
        np.testing.assert_allclose(np.diag(wider - spread), b * b / 16.0, rtol=0.15)


def test_motion_stretches_the_picture_along_its_way_and_leaves_its_middle():
    """2 m/s for 4 ms: a box of width w has the variance w^2/12; eight bits cut the faint ends."""
    images = ImageSource(CAMERAS, CELL.windows, ONE, ImageConfig(exposure=4e-3, brightness=200.0, **DARK))
    slow, fast = (expose(images, np.array([0.0, 0, 0, v, 0, 0])) for v in (0.0, 2.0))
    half = np.array([0.004, 0.0, 0.0])
    way = CAMERAS.project(X[:3, 3] + half) - CAMERAS.project(X[:3, 3] - half)
    assert np.abs(way).max() > 5.0
    for still, moving, w in zip(slow, fast, way, strict=True):
        light, middle, spread = moments(still)
        light_too, middle_too, wider = moments(moving)
        assert light_too == pytest.approx(light, rel=0.02)
        np.testing.assert_allclose(middle_too, middle, atol=0.03)
        np.testing.assert_allclose(wider - spread, np.outer(w, w) / 12.0, atol=0.1 + 0.03 * (w @ w) / 12.0)


def test_pixels_have_the_declared_noise_and_the_key_decides_it():
    """Inside markers, far from their edges; eight bits add 1/12 of a step squared."""
    images = source(noise_sigma=0.02, blur_sigma=0.3)
    once, again, other = (expose(images, key=key) for key in (KEY, KEY.copy(), KEY + 1e-12))
    inside = np.concatenate([p.pixels[p.pixels > 0.7 * FULL_SCALE] for p in once]) / FULL_SCALE
    assert len(inside) > 3000
    # The tails below 0.7 are cut, which edges fill up again; the quartiles know nothing of either.
    quartiles = np.quantile(inside, [0.25, 0.75])
    assert np.diff(quartiles)[0] / 1.349 == pytest.approx(0.02, rel=0.2)
    for one, two, three in zip(once, again, other, strict=True):
        np.testing.assert_array_equal(one.pixels, two.pixels)
        assert not np.array_equal(one.pixels, three.pixels)


def test_longer_exposures_are_brighter_until_eight_bits_are_full():
    for exposure, peak in ((3e-4, 0.6), (4e-4, 0.8), (8e-4, 1.0)):
        brightest = max(p.pixels.max() for p in expose(source(exposure=exposure, **DARK)))
        assert brightest == round(FULL_SCALE * peak)


def test_windows_hold_the_body_and_no_more_than_the_camera_shows():
    images = source(margin=10.0)
    windows, whole = images.windows(X), images.windows(None)
    pixels = CAMERAS.project(placed(X, BODY.p_E))
    assert np.all(pixels > windows[:, None, :2] + 9.0)
    assert np.all(pixels < windows[:, None, 2:] - 9.0)
    assert np.prod(windows[:, 2:] - windows[:, :2], axis=1).max() < 0.2 * 3071 * 1983
    assert np.all(whole[:, :2] >= CELL.windows[:, :2])
    assert np.all(whole[:, 2:] < CELL.windows[:, 2:])
    away = X.copy()
    away[2, 3] += 50.0
    assert all(picture.pixels.size == 0 for picture in images.expose(X, STILL, KEY, images.windows(away)))


def test_a_part_of_the_window_shows_the_same_pixels():
    images = source(**DARK)
    whole = images.expose(X, STILL, KEY, images.windows(None))
    for part, all_of_it in zip(expose(images), whole, strict=True):
        (h, w), (u, v) = part.pixels.shape, part.corner - all_of_it.corner
        np.testing.assert_array_equal(all_of_it.pixels[v : v + h, u : u + w], part.pixels)
        assert all_of_it.pixels.sum() == part.pixels.sum()


def test_what_the_arm_hides_is_dark():
    middle = 0.5 * (CAMERAS.p_WC + X[:3, 3])
    arm = Capsules(middle, middle, np.full(10, 0.3))
    assert all(p.pixels.max() == 0 for p in expose(source(**DARK), arm=arm))


def test_reflections_come_as_often_as_declared():
    """Only they are lit where the body is not; 1000 of them, whose sizes spread by 1.5 means: five sigma."""
    images = source(reflections=2.0, **DARK)
    far = X.copy()
    far[2, 3] -= 100.0  # below the floor, behind every camera or out of its window
    rng, windows = np.random.default_rng(0), images.windows(X)
    light = [
        sum(picture.pixels.sum() for picture in images.expose(far, STILL, rng.standard_normal(2), windows))
        for _ in range(50)
    ]
    # Half axes a and b are spread evenly in their logarithms, so the mean of pi a b is pi (mean of a)^2.
    mean_axis = (12.0 - 0.7) / np.log(12.0 / 0.7)
    assert np.mean(light) / FULL_SCALE == pytest.approx(10 * 2.0 * 0.8 * np.pi * mean_axis**2, rel=0.25)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"exposure": 0.0}, "images: exposure must be positive, got 0"),
        ({"noise_sigma": -1.0}, "images: noise_sigma must not be negative, got -1"),
        ({"noise_sigma": 0.1}, "the threshold must be between 0.65, six sigma above the background"),
        (
            {"exposure": 1e-5},
            "markers of brightness 2000 1/s stay below the threshold 0.4 in 1e-05 s",
        ),
    ],
)
def test_refuses_what_cannot_be(change: dict, message: str):
    with pytest.raises(ValueError, match=message):
        source(**change)
