"""The marker camera in a diagram: ports, stamps and delays of the pose camera, and errors of its own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform

from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error
from systems.cell.imaging.features import FeatureConfig
from systems.cell.imaging.images import ImageConfig
from systems.cell.marker_camera import (
    MarkerCamera,
    MarkerCameraConfig,
    MarkerFeaturesConfig,
    MarkerImagesConfig,
)
from systems.cell.pose_camera import BLOCK, ExposureConfig, PoseCamera, PoseCameraConfig
from systems.samples import PoseSample
from systems.vision.blobs.centroids import CentroidConfig
from systems.vision.camera_rig_file import cell_text, with_cameras
from systems.vision.tracking.tracker import TrackerConfig
from tests.systems.rigs import arrivals, camera_samples, pose
from tests.systems.vision.rigs import CELL

ROBOT = load_robot("irb1200")
Q = np.array([0.3, 0.4, 0.2, 0.1, 0.5, -0.2])
STILL = Kinematics(ROBOT).forward(Q)
EXACT = MarkerFeaturesConfig(features=FeatureConfig(pixel_sigma=0.0))


def still(time: float) -> RigidTransform:
    return pose(STILL)


def timed(config: ExposureConfig, markers: MarkerCameraConfig, level: str = "features") -> MarkerCameraConfig:
    """A camera that sees markers so, with these exposures."""
    kind = MarkerFeaturesConfig if level == "features" else MarkerImagesConfig
    return kind(**{**vars(markers), **vars(config)})


def each_exposure(
    config: ExposureConfig, markers: MarkerCameraConfig, count: int, level: str = "features", **kwargs
) -> list[PoseSample]:
    camera = MarkerCamera(timed(config, markers, level), ROBOT)
    return camera_samples(camera, config, arrivals(config, count), still, **kwargs)


def errors(found: list[PoseSample]) -> np.ndarray:
    return np.array([pose_error(sample.X_WE.GetAsMatrix4(), STILL) for sample in found])


def test_it_has_the_ports_of_the_pose_camera_and_one_that_may_stay_free():
    ours, theirs = MarkerCamera(MarkerFeaturesConfig()), PoseCamera(PoseCameraConfig())

    def inputs(system):
        return [system.get_input_port(i).get_name() for i in range(system.num_input_ports())]

    def outputs(system):
        ports = [system.get_output_port(i) for i in range(system.num_output_ports())]
        return [(port.get_name(), port.get_data_type(), port.size()) for port in ports]

    assert inputs(ours) == [*inputs(theirs), "motor_state"]
    assert outputs(ours) == outputs(theirs)


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.0075, 0.02])
def test_samples_come_when_those_of_the_pose_camera_come(delay: float):
    """The tip starts to rise at 10 ms; stamps and validity are equal, poses up to rounding."""
    config = ExposureConfig(delay=delay, dropouts=[[0.02, 0.03]])
    times = np.arange(1, 100) * 5e-4 + 1e-6

    def tip(time: float):
        X = STILL.copy()
        X[2, 3] += 0.1 * max(time - 0.01, 0.0)
        return pose(X)

    ours = camera_samples(MarkerCamera(timed(config, EXACT)), config, times, tip)
    theirs = camera_samples(PoseCamera(PoseCameraConfig(**vars(config))), config, times, tip)
    assert [sample.time for sample in ours] == [sample.time for sample in theirs]
    assert [sample.valid for sample in ours] == [sample.valid for sample in theirs]
    for mine, other in zip(ours, theirs, strict=True):
        if mine.valid:
            np.testing.assert_allclose(mine.X_WE.GetAsMatrix4(), other.X_WE.GetAsMatrix4(), atol=1e-9)


@pytest.mark.slow
def test_the_residual_is_the_spread_of_the_position():
    """Fifteen hundred numbers know a standard deviation to 1.8 %; four times that is allowed."""
    found = each_exposure(ExposureConfig(), MarkerFeaturesConfig(), 500)
    assert all(sample.valid for sample in found)
    residual = np.mean([sample.residual for sample in found])
    assert errors(found)[:, 3:].std() == pytest.approx(residual, rel=0.08)
    assert 1e-6 < residual < 1e-4
    assert each_exposure(ExposureConfig(), EXACT, 3)[-1].residual < 1e-12


def test_noise_is_new_in_every_exposure_and_block():
    found = errors(each_exposure(ExposureConfig(), MarkerFeaturesConfig(), 2 * BLOCK + 10))
    distance = np.abs(found[:, None] - found).max(-1) + np.eye(len(found))
    assert distance.min() > 1e-9


def test_the_seed_decides_the_noise():
    markers = MarkerFeaturesConfig(features=FeatureConfig(missing=0.2, false=0.1))
    once, again, other = (
        errors(each_exposure(ExposureConfig(), markers, 20, seed=seed)) for seed in (7, 7, 8)
    )
    np.testing.assert_array_equal(once, again)
    assert not np.isclose(once, other, rtol=0.0, atol=1e-9).any()


def test_the_arm_hides_markers_when_its_joints_are_known():
    """Without occlusion every camera sees the body; with it some do not, and the pose is less certain."""
    free = each_exposure(ExposureConfig(), MarkerFeaturesConfig(), 100)
    hidden = each_exposure(ExposureConfig(), MarkerFeaturesConfig(), 100, q=Q)
    assert all(sample.valid for sample in hidden)
    free_residual, hidden_residual = (np.mean([s.residual for s in found]) for found in (free, hidden))
    assert hidden_residual > 1.01 * free_residual


def test_a_body_out_of_sight_is_invalid_and_found_again_when_it_returns():
    away = STILL.copy()
    away[2, 3] += 50.0
    config = ExposureConfig(delay=0.0)

    def tip(time: float):
        return pose(away if 0.02 <= time < 0.1 else STILL)

    found = camera_samples(MarkerCamera(timed(config, EXACT)), config, arrivals(config, 40), tip)
    assert [i for i, sample in enumerate(found) if not sample.valid] == list(range(5, 25))
    np.testing.assert_allclose(found[10].X_WE.GetAsMatrix4(), STILL, atol=1e-9)  # the last one, repeated
    assert [sample.time for sample in found] == pytest.approx(4e-3 * np.arange(40))


def test_samples_are_lost_with_the_declared_probability():
    n = 400
    found = each_exposure(ExposureConfig(dropout_probability=0.3), EXACT, n)
    lost = sum(not sample.valid for sample in found)
    assert abs(lost - 0.3 * n) < 4.0 * np.sqrt(0.21 * n)


def test_by_images_the_pose_is_as_good_as_its_residual_says():
    """Fifty poses with errors of hundredths of a pixel; also what images and pixels know is shared."""
    found = each_exposure(ExposureConfig(), MarkerFeaturesConfig(), 50, "images", q=Q)
    assert all(sample.valid for sample in found)
    residual = np.mean([sample.residual for sample in found])
    assert 1e-6 < residual < 1e-5
    assert np.abs(errors(found)[:, 3:]).max() < 10.0 * residual


@pytest.mark.slow
def test_by_images_a_body_is_followed_in_motion_among_reflections():
    """1 m/s upwards; two reflections in every window, some of them round and as large as a marker."""
    markers = MarkerFeaturesConfig(images=ImageConfig(reflections=2.0))
    config = ExposureConfig(delay=0.0)

    def rising(time: float):
        X = STILL.copy()
        X[2, 3] += time
        return pose(X)

    found = camera_samples(
        MarkerCamera(timed(config, markers, "images"), ROBOT), config, arrivals(config, 60), rising
    )
    height = np.array([sample.X_WE.translation()[2] - sample.time for sample in found])
    assert all(sample.valid for sample in found)
    np.testing.assert_allclose(height, STILL[2, 3], atol=5e-5)


def test_by_images_a_body_is_found_again_after_a_break():
    """It is longer than a prediction lasts, so that the whole windows are searched."""
    config = ExposureConfig(delay=0.0, period=0.02, dropouts=[[0.09, 0.29]])
    found = each_exposure(config, MarkerFeaturesConfig(), 20, "images")
    assert [i for i, sample in enumerate(found) if not sample.valid] == list(range(5, 15))
    assert np.abs(errors(found)[:, 3:]).max() < 1e-4


@pytest.mark.slow
def test_by_images_the_seed_decides_the_noise():
    once, again, other = (
        errors(each_exposure(ExposureConfig(), MarkerFeaturesConfig(), 5, "images", seed=seed))
        for seed in (7, 7, 8)
    )
    np.testing.assert_array_equal(once, again)
    assert not np.isclose(once, other, rtol=0.0, atol=1e-9).any()


def shifted_cell(folder: Path, by_mm: float, cameras: int = 10) -> str:
    """The file of a cell whose cameras, or the first of them, are believed to stand beside their places."""
    true = CELL.camera_model(CELL.base.pose())
    believed = replace(true, p_WC=true.p_WC + 1e-3 * by_mm)
    cell = with_cameras(CELL, believed, "shifted")
    (folder / "shifted.yaml").write_text(cell_text(replace(cell, cameras=cell.cameras[:cameras])))
    return str(folder / "shifted.yaml")


@pytest.mark.parametrize("level", ["features", "images"])
def test_a_calibration_that_is_off_moves_the_pose_with_it(tmp_path: Path, level: str):
    """2 mm along each axis: so is the pose then, and cameras and pixels agree none the less."""
    markers = replace(EXACT, calibration=shifted_cell(tmp_path, 2.0))
    found = each_exposure(ExposureConfig(), markers, 3, level)
    np.testing.assert_allclose(np.abs(errors(found)[:, 3:]), 2e-3, atol=2e-5)
    assert found[-1].residual < 1e-5


def test_a_calibration_of_other_cameras_is_refused(tmp_path: Path):
    markers = MarkerFeaturesConfig(calibration=shifted_cell(tmp_path, 0.0, cameras=9))
    with pytest.raises(
        ValueError, match=r"must have the cameras of the cell, 01, .* 10, got 01, .* 09; station.camera.cell"
    ):
        MarkerCamera(timed(ExposureConfig(), markers))


@pytest.mark.parametrize(
    ("config", "markers", "message"),
    [
        (ExposureConfig(period=0.0), MarkerFeaturesConfig(), "camera: period must be positive"),
        (ExposureConfig(), MarkerFeaturesConfig(cell="nowhere"), "cell 'nowhere': no file"),
        (ExposureConfig(), MarkerFeaturesConfig(body="nothing"), "body 'nothing': no file"),
        (ExposureConfig(), MarkerFeaturesConfig(features=FeatureConfig(missing=2.0)), "features: missing"),
        (ExposureConfig(), MarkerFeaturesConfig(images=ImageConfig(exposure=0.0)), "images: exposure"),
        (ExposureConfig(), MarkerFeaturesConfig(centroids=CentroidConfig(longest=0.5)), "centroids: longest"),
        (ExposureConfig(), MarkerFeaturesConfig(tracker=TrackerConfig(gate=-1.0)), "tracker: gate"),
    ],
)
def test_refuses_what_no_camera_can_be(config: ExposureConfig, markers: MarkerCameraConfig, message: str):
    with pytest.raises(ValueError, match=message):
        MarkerCamera(timed(config, markers))
