"""What limits a pose from cameras: the sweeps of a study obey the laws that geometry and light impose."""

from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from experiments.cameras.accuracy import accuracy, centroid_errors, information, pose_covariance
from experiments.cameras.report import print_study, write_study_page
from experiments.cameras.study import CamerasStudy, covariances, study_json, study_setup
from experiments.cameras.sweeps import SWEEPS, SweepPoint, SweepSetup
from experiments.cameras.variations import best_subsets, ring, with_markers
from experiments.cli.prepare import prepare


@cache
def setup() -> SweepSetup:
    return study_setup(prepare("misaligned", ["station.camera=images"]))


def swept(name: str, *values: float) -> list[SweepPoint]:
    return [SWEEPS[name].study(setup(), value) for value in values]


@pytest.mark.slow
def test_the_pose_is_as_uncertain_as_the_pixels():
    half, whole = swept("pixel_noise", 0.05, 0.1)
    assert whole.path.position == pytest.approx(2.0 * half.path.position)
    assert whole.workspace.rotation == pytest.approx(2.0 * half.workspace.rotation)


@pytest.mark.slow
def test_more_cameras_more_markers_and_a_larger_body_know_more():
    for name, values in (("cameras", (2, 4, 7, 10)), ("markers", (4, 6, 8, 11))):
        positions = [point.path.position for point in swept(name, *values)]
        assert positions == sorted(positions, reverse=True)
    rotations = [point.path.rotation for point in swept("body", 0.5, 1.0, 2.0)]
    assert rotations == sorted(rotations, reverse=True)


@pytest.mark.slow
def test_farther_away_the_position_is_uncertain_in_proportion():
    """The distance is that on the slant, sqrt(radius^2 + 2^2); more markers touch far away."""
    near, far = swept("distance", 4.0, 8.0)
    ratio = np.hypot(8.0, 2.0) / np.hypot(4.0, 2.0)
    assert far.path.position / near.path.position == pytest.approx(ratio, rel=0.1)


@pytest.mark.slow
def test_exposure_has_an_optimum():
    """Too short is dark, too long is saturated and smeared."""
    dark, right, long = swept("exposure", 0.2, 0.4, 3.2)
    assert right.pixel_sigma < 0.5 * dark.pixel_sigma
    assert right.pixel_sigma < 0.7 * long.pixel_sigma
    assert dark.found <= right.found == 1.0


def test_a_sweep_of_one_value_has_no_row_and_no_picture(tmp_path: Path):
    """As of the number of cameras of a cell that has two."""
    noise, cameras = swept("pixel_noise", 0.05, 0.1), swept("cameras", 2)
    known = covariances(setup())
    console = Console(width=120, record=True, file=StringIO())
    study = CamerasStudy(setup(), *known, {"pixel_noise": noise, "cameras": cameras}, [])
    print_study(console, study)
    write_study_page(tmp_path / "study.html", "two cameras", study)
    for text in (console.export_text(), (tmp_path / "study.html").read_text()):
        assert "Noise of the pixels" in text
        assert "Number of cameras" not in text
    assert list(study_json(study)["sweeps"]) == ["pixel_noise", "cameras"]


def test_what_no_camera_can_do_is_a_value_without_a_result():
    """With noise of a tenth of full scale, six sigma of it reach the threshold."""
    (point,) = swept("sensor_noise", 0.1)
    assert point.found == 0.0
    assert point.path.seen == 0.0
    assert point.as_dict()["pixel_sigma"] is None


@pytest.mark.slow
def test_more_pixels_are_worth_more_than_in_proportion():
    """Twice as many along an edge halve the angle of a pixel, and the centroid has more of them."""
    coarse, fine = swept("resolution", 1.0, 2.0)
    assert fine.path.position < 0.5 * coarse.path.position


def test_ten_cameras_are_all_there_are_and_the_best_two_are_better_than_any_others():
    point = swept("cameras", 10)[0]
    assert sorted(point.cameras) == sorted(camera.name for camera in setup().cell.cameras)
    cameras = setup().cell.camera_model()
    known = information(cameras, setup().cell.windows, setup().body, setup().path, setup().robot)
    best = best_subsets(known)[0]

    def spread(pair: list[int]) -> float:
        variances = np.diagonal(pose_covariance(known[:, pair].sum(1), 1.0), axis1=1, axis2=2)[:, 3:]
        return float(np.nan_to_num(variances.sum(1), nan=1.0).sum())

    assert all(spread(best) <= spread([i, j]) for i in range(10) for j in range(i))


def test_a_pose_that_two_cameras_do_not_see_is_not_known():
    known = np.zeros((3, 10, 6, 6))
    known[0] = 1e6 * np.eye(6)
    found = accuracy(pose_covariance(known.sum(1), 0.1))
    assert found.seen == pytest.approx(1.0 / 3.0)
    assert found.position == pytest.approx(0.1 / np.sqrt(1e7))
    nothing = accuracy(pose_covariance(known[1:].sum(1), 0.1))
    assert nothing.as_dict()["position_um"] is None


def test_cameras_on_a_ring_look_at_the_target():
    cell = ring(setup().cell, 5, 3.0, 1.0, 360.0)
    cameras = cell.camera_model()
    pixels = cameras.project(1e-3 * cell.target_mm)
    np.testing.assert_allclose(pixels, np.tile(0.5 * np.asarray(cell.sensor_px), (5, 1)), atol=1e-6)
    distance = np.linalg.norm(cameras.p_WC - 1e-3 * cell.target_mm, axis=1)
    np.testing.assert_allclose(distance, np.hypot(3.0, 1.0))


def test_the_markers_that_remain_are_far_from_each_other():
    four = with_markers(setup().body, 4)
    assert len(four) == 4
    apart = four.distances[np.triu_indices(4, 1)].min()
    assert apart > setup().body.distances[np.triu_indices(11, 1)].min()


def test_centroid_errors_count_lone_markers_only():
    X, cell = setup().path.X_WE[0], setup().cell
    cameras = cell.camera_model()
    true = cameras.project(setup().body.p_E @ X[:3, :3].T + X[:3, 3])
    error, count = centroid_errors(cameras, cell.windows, setup().body, X, true + np.array([0.3, -0.4]))
    assert 30 < count < 110
    np.testing.assert_allclose(error, np.tile([0.3, -0.4], (count, 1)), atol=1e-9)


def test_the_covariance_of_the_cell_is_symmetric_and_positive():
    for covariance in covariances(setup()):
        assert np.linalg.eigvalsh(covariance).min() > 0.0
