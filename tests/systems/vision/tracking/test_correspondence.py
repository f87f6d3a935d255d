"""An unknown scene: blobs of the same point are put together, and no others."""

import numpy as np

from systems.vision.tracking.correspondence import SceneMatcher, blobs_of_points
from tests.systems.vision.rigs import BODY, CAMERAS, placed, random_pose, shuffled

MATCHER = SceneMatcher(CAMERAS, tolerance=0.9)


def markers_of(points: np.ndarray, order: np.ndarray) -> list[set[int]]:
    """For each point the markers that its blobs come from."""
    camera = np.arange(len(CAMERAS))
    return [set(order[camera[point >= 0], point[point >= 0]].tolist()) for point in points]


def test_without_noise_every_marker_is_one_point_seen_by_all_cameras():
    rng = np.random.default_rng(0)
    for _ in range(20):
        blobs, order = shuffled(CAMERAS.project(placed(random_pose(rng), BODY.p_E)), rng)
        points = MATCHER.match(blobs)
        assert points.shape == (len(BODY), len(CAMERAS))
        assert sorted(marker for group in markers_of(points, order) for marker in group) == list(range(11))
        assert np.all(points >= 0)


def test_missing_and_false_blobs_do_not_mix_markers():
    """A blob within the tolerance of where another marker would be may be taken for it; that is rare."""
    rng = np.random.default_rng(1)
    pure = total = 0
    for _ in range(20):
        pixels = CAMERAS.project(placed(random_pose(rng), BODY.p_E))
        pixels += 0.1 * rng.standard_normal(pixels.shape)
        missing = rng.random(pixels.shape[:2]) < 0.1
        pixels[missing] = np.nan
        middle = np.nanmean(pixels, axis=1, keepdims=True)
        false = middle + rng.uniform(-100.0, 100.0, (len(CAMERAS), 2, 2))
        blobs, order = shuffled(np.concatenate([pixels, false], axis=1), rng)
        groups = markers_of(MATCHER.match(blobs), order)
        total += len(groups)
        pure += sum(len(group) == 1 for group in groups)
        found = {marker for group in groups for marker in group if len(group) == 1}
        assert len(found & set(range(len(BODY)))) >= 8
    assert pure >= 0.9 * total


def test_an_empty_scene_has_no_points():
    assert MATCHER.match(np.full((len(CAMERAS), 5, 2), np.nan)).shape == (0, len(CAMERAS))


def test_a_blob_belongs_to_one_point_only():
    rng = np.random.default_rng(2)
    blobs = CAMERAS.project(placed(random_pose(rng), BODY.p_E)) + 0.1 * rng.standard_normal((10, 11, 2))
    points = MATCHER.match(blobs)
    for seen in points.T:
        used = seen[seen >= 0]
        assert len(np.unique(used)) == len(used)


def test_pixels_of_points_are_picked_by_index():
    blobs = np.arange(12.0).reshape(2, 3, 2)
    pixels = blobs_of_points(blobs, np.array([[2, -1], [0, 1]]))
    np.testing.assert_array_equal(pixels, [[[4, 5], [np.nan, np.nan]], [[6, 7], [8, 9]]])
