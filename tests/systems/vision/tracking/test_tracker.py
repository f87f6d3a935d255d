"""The tracker: it holds over the test path, finds the body again, and never takes one marker for another."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.kinematics.analytic_inverse import InverseKinematics
from robots.kinematics.arm_capsules import ArmCapsules
from robots.pose import pose_error
from systems.cell.imaging.features import FeatureConfig, FeatureSource
from systems.reference.paths import ReferenceConfig, make_path
from systems.vision.tracking.pose_refinement import moved
from systems.vision.tracking.tracker import TrackedPose, Tracker, TrackerConfig, TrackerState
from tests.systems.vision.rigs import BODY, CAMERAS, CELL, placed, random_pose, shuffled

PERIOD = 4e-3  # s
ROBOT = load_robot("irb1200")
ARM = ArmCapsules(ROBOT)
TRACKER = Tracker(CAMERAS, BODY)
NOISY = FeatureConfig(pixel_sigma=0.1, missing=0.1, false=0.05)
NOTHING = np.full((len(CAMERAS), 15, 2), np.nan)


@cache
def path_and_joints(every: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, poses of the tool and joint positions on the test path, at every so manyth frame."""
    path, inverse = make_path(ReferenceConfig(dwell=0.0)), InverseKinematics(ROBOT)
    times = np.arange(0.0, path.duration, every * PERIOD)
    poses, q, joints = path.sample(times)[0], np.zeros(6), []
    for X in poses:
        q = inverse.nearest(X, q)
        joints.append(q)
    return times, poses, np.array(joints)


def frames(config: FeatureConfig, poses: np.ndarray, joints: np.ndarray) -> list[np.ndarray]:
    source, rng = FeatureSource(CAMERAS, CELL.windows, BODY, config), np.random.default_rng(0)
    return [
        source.blobs(X, rng.standard_normal(source.noise_size), ARM.at(q))
        for X, q in zip(poses, joints, strict=True)
    ]


def follow(times: np.ndarray, pictures: list[np.ndarray]) -> list[TrackedPose]:
    state, found = TrackerState(), []
    for time, blobs in zip(times, pictures, strict=True):
        state, pose = TRACKER.track(state, time, blobs)
        found.append(pose)
    return found


def assert_no_marker_is_exchanged(found: TrackedPose, blobs: np.ndarray, X: np.ndarray) -> None:
    """Every blob that was used lies where the marker that it was taken for truly is; noise is 0.1 px."""
    true = CAMERAS.project(placed(X, BODY.p_E))
    camera, marker = np.nonzero(found.blobs >= 0)
    used = blobs[camera, found.blobs[camera, marker]]
    assert np.abs(used - true[camera, marker]).max() < 0.8


def assert_holds(times: np.ndarray, poses: np.ndarray, joints: np.ndarray) -> None:
    pictures = frames(NOISY, poses, joints)
    found = follow(times, pictures)
    assert [pose.recovered for pose in found] == [True] + [False] * (len(found) - 1)
    for pose, blobs, X in zip(found, pictures, poses, strict=True):
        assert pose.valid
        assert pose.fit is not None
        assert_no_marker_is_exchanged(pose, blobs, X)
        error = pose_error(pose.X_WE, X)
        assert error @ np.linalg.solve(0.1**2 * pose.fit.cofactor, error) < 50.0  # chi^2 of 6: 5e-9


@pytest.mark.slow
def test_tracking_holds_with_occlusion_false_and_missing_blobs():
    times, poses, joints = path_and_joints(1)
    part = slice(300, 700)  # about the fastest part of the first edge
    assert_holds(times[part], poses[part], joints[part])


@pytest.mark.slow
def test_tracking_holds_over_the_whole_test_path():
    assert_holds(*path_and_joints(1))


def test_without_noise_the_pose_is_exact_along_the_path():
    times, poses, joints = path_and_joints(50)
    pictures = frames(FeatureConfig(pixel_sigma=0.0), poses, joints)
    for pose, X in zip(follow(times, pictures), poses, strict=True):
        assert pose.valid
        np.testing.assert_allclose(pose.X_WE, X, atol=1e-9)


def test_after_a_second_without_view_the_next_picture_is_enough():
    times, poses, joints = path_and_joints(1)
    part = slice(0, 500)
    pictures = frames(NOISY, poses[part], joints[part])
    dark = range(100, 350)
    for i in dark:
        pictures[i] = NOTHING
    found = follow(times[part], pictures)
    assert [i for i, pose in enumerate(found) if not pose.valid] == list(dark)
    assert [i for i, pose in enumerate(found) if pose.recovered] == [0, 350]
    assert np.abs(pose_error(found[350].X_WE, poses[350])[3:]).max() < 2e-4


@pytest.mark.slow
def test_a_wrong_prediction_is_corrected_or_refused_but_never_kept():
    """Wherever the tracker believes the body to be, up to a marker's distance away and turned at will."""
    rng, refused = np.random.default_rng(4), 0
    for _ in range(150):
        X = random_pose(rng, 0.1)
        pixels = CAMERAS.project(placed(X, BODY.p_E))
        blobs, _ = shuffled(pixels + 0.1 * rng.standard_normal(pixels.shape), rng)
        wrong = moved(X, np.concatenate([rng.normal(0.0, 1.0, 3), rng.normal(0.0, 0.05, 3)]))
        _, found = TRACKER.track(TrackerState(0.0, wrong), PERIOD, blobs)
        assert found.valid
        assert np.abs(pose_error(found.X_WE, X)).max() < 2e-3
        refused += found.recovered
    assert refused > 100  # a few predictions are near enough to be corrected by the pixels themselves


def test_a_second_body_of_the_same_kind_is_refused_at_first_and_ignored_while_the_first_is_tracked():
    rng = np.random.default_rng(5)
    first, second = random_pose(rng, 0.1), random_pose(rng, 0.1)
    second[:3, 3] += [0.0, 0.5, 0.0]
    both = np.concatenate([CAMERAS.project(placed(X, BODY.p_E)) for X in (first, second)], axis=1)
    blobs, _ = shuffled(both, rng)
    assert not TRACKER.track(TrackerState(), 0.0, blobs)[1].valid
    _, found = TRACKER.track(TrackerState(0.0, first), PERIOD, blobs)
    assert found.valid
    np.testing.assert_allclose(found.X_WE, first, atol=1e-9)


def seen_only(X: np.ndarray, cameras: int, markers: int) -> np.ndarray:
    pixels = CAMERAS.project(placed(X, BODY.p_E))
    pixels[cameras:], pixels[:, markers:] = np.nan, np.nan
    return pixels


@pytest.mark.parametrize(
    ("cameras", "markers", "reason"),
    [
        (2, 11, ""),
        (10, 4, ""),
        (10, 3, "3 markers are seen by two cameras, needs 4"),
        (1, 11, "0 markers are seen by two cameras, needs 4"),
        (0, 0, "at least three pixels, got 0"),
    ],
)
def test_two_cameras_and_four_markers_are_needed(cameras: int, markers: int, reason: str):
    X = random_pose(np.random.default_rng(6), 0.1)
    _, found = TRACKER.track(TrackerState(0.0, X), PERIOD, seen_only(X, cameras, markers))
    assert found.valid == (not reason)
    assert reason in found.reason


def test_pixels_that_scatter_more_than_expected_are_refused():
    rng, X = np.random.default_rng(7), random_pose(np.random.default_rng(7), 0.1)
    pixels = CAMERAS.project(placed(X, BODY.p_E))
    pixels += rng.uniform(-0.5, 0.5, pixels.shape)
    _, found = TRACKER.track(TrackerState(0.0, X), PERIOD, pixels)
    assert not found.valid
    assert "px are expected" in found.reason


def test_all_that_is_seen_is_used_merged_blobs_too():
    """The Cramer-Rao bound of the blobs, by finite differences of what the cameras report, is allowed 2 %.

    Lost is only what is too near to something else to be told from it.
    """
    source, nothing = FeatureSource(CAMERAS, CELL.windows, BODY, FeatureConfig(0.0)), np.zeros(1_000)
    rng, h, merged = np.random.default_rng(9), 1e-7, 0
    for _ in range(20):
        X = random_pose(rng, 0.2)

        def seen(pose: np.ndarray) -> np.ndarray:
            return source.blobs(pose, nothing[: source.noise_size])

        blobs = seen(X)
        columns = [(seen(moved(X, h * axis)) - seen(moved(X, -h * axis))) / (2 * h) for axis in np.eye(6)]
        J = np.stack(columns, -1)[~np.isnan(blobs)]
        bound = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
        fit = TRACKER.track(TrackerState(0.0, X), PERIOD, blobs)[1].fit
        assert fit is not None
        ratio = np.sqrt(np.diag(fit.cofactor)) / bound
        assert 0.999 < ratio.min() <= ratio.max() < 1.02
        merged += np.sum(~np.isnan(blobs[..., 0])) < len(CAMERAS) * len(BODY)
    assert merged == 20  # there are some in every pose


def test_the_residual_is_the_standard_deviation_of_the_position():
    """500 measurements of three axes tell it to 1.8 %; four times that."""
    rng, X = np.random.default_rng(8), random_pose(np.random.default_rng(8), 0.1)
    pixels = CAMERAS.project(placed(X, BODY.p_E))
    found = [
        TRACKER.track(TrackerState(0.0, X), PERIOD, pixels + 0.1 * rng.standard_normal(pixels.shape))[1]
        for _ in range(500)
    ]
    error = np.array([pose.X_WE[:3, 3] - X[:3, 3] for pose in found])
    assert np.mean([pose.position_sigma for pose in found]) == pytest.approx(error.std(), rel=0.08)


def test_the_memory_is_a_vector():
    state = TrackerState(1.5, random_pose(np.random.default_rng(0)), np.arange(6.0))
    again = TrackerState.from_vector(state.to_vector())
    assert again.time == state.time
    np.testing.assert_array_equal(again.X_WE, state.X_WE)
    np.testing.assert_array_equal(again.V_WE, state.V_WE)
    assert TrackerState.from_vector(TrackerState().to_vector()).time == -np.inf


def test_a_body_that_looks_the_same_in_two_ways_is_refused():
    square = np.array([[0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0], [50, 50, 40]])
    with pytest.raises(ValueError, match="look the same in two ways, within 1 mm"):
        Tracker(CAMERAS, replace(BODY, markers_mm=square))
    Tracker(CAMERAS, replace(BODY, markers_mm=square + np.eye(5, 3) * [10, 10, 10]))


@pytest.mark.parametrize("name", ["gate", "pixel_sigma", "coast"])
def test_refuses_numbers_that_are_not_positive(name: str):
    with pytest.raises(ValueError, match=f"tracker: {name} must be positive, got 0"):
        Tracker(CAMERAS, BODY, replace(TrackerConfig(), **{name: 0.0}))
