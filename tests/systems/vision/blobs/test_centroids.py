"""Centroids: within a tenth of a px of the truth, and nothing that does not look like a marker."""

import cv2
import numpy as np
import pytest

from systems.cell.imaging.images import ImageConfig, ImageSource
from systems.vision.blobs.centroids import CentroidConfig, blobs_in, centroids, check_centroids
from systems.vision.camera_model import Cameras
from systems.vision.kernels.components import components
from systems.vision.rendering import Picture
from systems.vision.tracking.marker_images import marker_diameters, touching
from tests.systems.vision.rigs import BODY, CAMERAS, CELL, placed, random_pose

CONFIG = CentroidConfig()


def errors(images: ImageConfig, V_WE: np.ndarray | None = None, count: int = 8) -> np.ndarray:
    """Pixels found minus projected truth, (k, 2), of markers that stand alone, at poses near the path."""
    rng, source, found = np.random.default_rng(0), ImageSource(CAMERAS, CELL.windows, BODY, images), []
    for _ in range(count):
        X = random_pose(rng, 0.1)
        p_W = placed(X, BODY.p_E)
        true = CAMERAS.project(p_W)
        alone = ~touching(true, 1.1 * marker_diameters(CAMERAS, BODY, p_W) + 3.0).any(2)
        pictures = source.expose(
            X, np.zeros(6) if V_WE is None else V_WE, rng.standard_normal(2), source.windows(X)
        )
        blobs = blobs_in(pictures, CAMERAS, CONFIG)
        offset = true[:, :, None] - blobs[:, None]
        nearest = np.nanargmin(np.linalg.norm(offset, axis=-1), axis=2)
        found.append(-np.take_along_axis(offset, nearest[..., None, None], 2)[alone][:, 0])
    return np.concatenate(found)


def disc(center: tuple[float, float], half: tuple[float, float], size: int = 60) -> np.ndarray:
    v, u = np.indices((size, size))
    return (((u - center[0]) / half[0]) ** 2 + ((v - center[1]) / half[1]) ** 2 < 1.0).astype(np.uint8) * 200


def found_in(pixels: np.ndarray, **config) -> np.ndarray:
    return centroids(Picture(pixels, np.array([0, 0])), CentroidConfig(**config))[0]


@pytest.mark.slow
def test_every_marker_that_stands_alone_is_found_within_a_tenth_of_a_pixel():
    """Noise of one percent of full scale; spheres of 5 to 25 px, up to 1500 px from the axis."""
    error = errors(ImageConfig())
    assert len(error) > 600
    assert np.abs(error).max() < 0.1
    assert error.std() < 0.02
    assert np.abs(error.mean(0)).max() < 4.0 * 0.02 / np.sqrt(len(error))


def test_the_error_grows_with_the_noise_and_not_with_the_speed():
    quiet, usual, loud = (errors(ImageConfig(noise_sigma=s)).std() for s in (0.0, 0.01, 0.05))
    assert quiet < usual < loud < 0.06
    moving = errors(ImageConfig(), np.array([0.0, 0, 0, 1.0, 1.0, 0.0])).std()
    assert moving == pytest.approx(usual, rel=0.2)


def test_a_symmetric_blob_is_found_at_its_centre_in_the_whole_image():
    picture = Picture(disc((30.0, 25.5), (6.0, 5.0)), np.array([1000, 200]))
    middle, area = centroids(picture, CONFIG)
    np.testing.assert_allclose(middle, [[1030.0, 225.5]], atol=1e-12)
    assert area == np.count_nonzero(picture.pixels)


def test_brightness_weighs_what_is_above_the_threshold():
    """Two columns of pixels, one 50 and one 100 steps above the threshold of 102."""
    pixels = np.zeros((20, 20), np.uint8)
    pixels[8:12, 8:10], pixels[8:12, 10:12] = 152, 202
    assert found_in(pixels)[0] == pytest.approx([(50 * 8.5 + 100 * 10.5) / 150, 9.5])


def test_a_blob_that_dims_does_not_jump_as_its_edge_drops_below_the_threshold():
    base = disc((30.0, 30.0), (6.0, 6.0)).astype(float)
    base[30, 36:38] = 103.5  # an appendix that crosses the level of 102 as the light fades
    middles = [found_in((share * base).astype(np.uint8))[0, 0] for share in np.linspace(1.0, 0.97, 13)]
    assert np.abs(np.diff(middles)).max() < 0.003


WRONG = {
    "one pixel": disc((30, 30), (0.5, 0.5)),
    "a scratch": disc((30, 30), (12.0, 1.5)),
    "two spheres that touch": np.maximum(disc((24, 30), (6.0, 6.0)), disc((35, 30), (6.0, 6.0))),
    "a ring": disc((30, 30), (10.0, 10.0)) - disc((30, 30), (7.0, 7.0)),
    "a sphere at the edge": disc((3, 30), (6.0, 6.0)),
    "a wall": np.full((80, 80), 200, np.uint8),
    "nothing": np.zeros((60, 60), np.uint8),
    "no window": np.zeros((0, 0), np.uint8),
}


@pytest.mark.parametrize("pixels", WRONG.values(), ids=WRONG)
def test_what_does_not_look_like_a_sphere_is_left_out(pixels: np.ndarray):
    assert len(found_in(pixels)) == 0


def test_a_sphere_beside_wrong_blobs_is_found_all_the_same():
    for pixels in WRONG.values():
        if pixels.shape == (60, 60):
            beside = np.hstack([pixels, disc((30, 30), (6.0, 6.0))])
            np.testing.assert_allclose(found_in(beside), [[90.0, 30.0]], atol=1e-12)


def test_blobs_of_cameras_are_padded_and_shifted_by_their_size():
    """An area A shifts by x A / (pi f sqrt(1 + x^2)) px, here with x = 99.5/500 and A = 400 px."""
    two = np.zeros((2, 2))
    cameras = Cameras(two + 500.0, two, np.zeros((2, 3)), two, np.stack([np.eye(3)] * 2), np.zeros((2, 3)))
    square = np.zeros((40, 40), np.uint8)
    square[10:30, 10:30] = 200
    pictures = [Picture(square, np.array([80, -19])), Picture(0 * square, np.array([0, 0]))]
    blobs = blobs_in(pictures, cameras, CONFIG)
    assert blobs.shape == (2, 1, 2)
    shift = 0.199 * 400.0 / (np.pi * 500.0 * np.sqrt(1.0 + 0.199**2))
    np.testing.assert_allclose(blobs[0, 0], [99.5 - shift, 0.5], atol=1e-3)
    assert np.isnan(blobs[1]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"threshold": 1.0}, "threshold must be between 0 and 1, got 1"),
        ({"smallest": 9, "largest": 8}, "smallest must be positive and at most largest, got 9 and 8 px"),
        ({"longest": 1.0}, "longest must be above 1, got 1"),
        ({"least_filled": 1.5}, r"least_filled must be in \[0, 1\), got 1.5"),
    ],
)
def test_refuses_what_cannot_be(change: dict, message: str):
    with pytest.raises(ValueError, match=f"centroids: {message}"):
        check_centroids(CentroidConfig(**change))


def test_an_image_with_more_lights_than_memory_was_laid_out_for_is_read_all_the_same():
    pixels = np.zeros((400, 400), np.uint8)
    for v in range(10, 390, 10):
        for u in range(10, 390, 10):
            cv2.circle(pixels, (u, v), 3, 200, -1)
    middles = found_in(pixels)
    assert {tuple(middle) for middle in middles.round(6)} == {
        (u, v) for v in range(10, 390, 10) for u in range(10, 390, 10)
    }


def test_shapes_that_join_late_are_one_component():
    """Arms that meet only at the foot of a U or in the middle of a W belong together."""
    pixels = np.zeros((60, 60), np.uint8)
    for top in ([(10, 5), (20, 40), (30, 5), (40, 40), (50, 5)], [(10, 30), (5, 50), (55, 50)]):
        cv2.polylines(pixels, [np.array(top)], False, 200, 1)
    _, plain, is_whole = components(pixels, 102, 1000)
    assert len(plain) == cv2.connectedComponents(pixels, connectivity=8)[0] - 1
    assert plain[:, 0].sum() == np.count_nonzero(pixels)
    assert is_whole.all()


@pytest.mark.slow
def test_components_are_those_of_opencv_wherever_they_lie():
    """Discs and noise anywhere, also across edges: areas and middles as OpenCV counts them."""
    rng, count = np.random.default_rng(4), 0
    config = CentroidConfig(threshold=0.1, smallest=1, longest=4.0, least_filled=0.1)
    level = 25
    for _ in range(200):
        pixels = (rng.random((50, 60)) < 0.01).astype(np.uint8) * np.uint8(80)
        for _ in range(rng.integers(0, 5)):
            middle = tuple(int(x) for x in rng.integers(-3, 63, 2))
            cv2.circle(pixels, middle, int(rng.integers(2, 8)), int(rng.integers(30, 256)), -1)
        middles, areas = centroids(Picture(pixels, np.array([7, 11])), config)
        lit = (pixels > level).astype(np.uint8)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(lit, connectivity=8)
        left, top, width, height, area = stats[1:].T
        whole = (left > 0) & (top > 0) & (left + width < 60) & (top + height < 50)
        expected = []
        for label in 1 + np.flatnonzero(whole):
            v, u = np.nonzero(labels == label)
            expected.append(np.average([u + 7, v + 11], axis=1, weights=pixels[v, u] - float(level)))
        # Some are too long or too hollow for a marker; those that are left are each another one.
        where = [int(np.abs(np.array(expected) - found).sum(axis=1).argmin()) for found in middles]
        assert len(where) == len(set(where))
        for found, size, k in zip(middles, areas, where, strict=True):
            np.testing.assert_allclose(found, expected[k], atol=1e-9)
            assert size == area[whole][k]
        count += len(areas)
    assert count > 500
