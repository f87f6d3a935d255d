"""The pose camera: when a sample is taken and when it arrives, how it is spread, which ones are lost."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from robots.pose import pose_error, rotation_from_zyx
from systems.cell.pose_camera import PoseCamera, PoseCameraConfig
from systems.samples import PoseSample
from tests.systems.rigs import arrivals, camera_samples, pose

STILL = np.eye(4)
STILL[:3, :3] = rotation_from_zyx(np.array([0.4, -0.7, 1.1]))
STILL[:3, 3] = [0.3, -0.4, 0.5]


def samples(
    config: PoseCameraConfig, times: np.ndarray, tip=lambda time: pose(STILL), seed: int = 0
) -> list[PoseSample]:
    """What the camera reports at the given times."""
    return camera_samples(PoseCamera(config), config, times, tip, seed=seed)


def each_exposure(config: PoseCameraConfig, count: int, seed: int = 0) -> list[PoseSample]:
    """The first samples, one from each exposure, read when they have arrived."""
    return samples(config, arrivals(config, count), seed=seed)


def step_to(time_of_step: float, height: float):
    return lambda time: RigidTransform([0.0, 0.0, height if time >= time_of_step - 1e-9 else 0.0])


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.006, 0.0075, 0.04])
def test_a_step_is_seen_a_delay_after_its_exposure_and_bears_the_stamp_of_it(delay: float):
    """The step lies between the exposures at 16 and 20 ms; the latter shows it."""
    config = PoseCameraConfig(delay=delay)
    times = np.arange(1, 300) * 2.5e-4 + 1e-6  # just after the instants at which samples arrive
    found = samples(config, times, step_to(0.018, 0.1))
    heights = np.array([sample.X_WE.translation()[2] for sample in found])
    first = np.flatnonzero(heights > 0.0)[0]
    assert times[first] == pytest.approx(0.020 + delay, abs=2e-6)
    assert found[first].time == pytest.approx(0.020)
    assert np.all(heights[first:] == 0.1)


def test_nothing_is_valid_before_the_first_sample_has_arrived():
    times = np.arange(1, 40) * 1e-3 + 1e-6
    valid = [sample.valid for sample in samples(PoseCameraConfig(delay=0.02), times)]
    np.testing.assert_array_equal(valid, times >= 0.02)


def test_without_noise_the_sample_is_the_tip():
    for sample in each_exposure(PoseCameraConfig(), 5):
        np.testing.assert_array_equal(sample.X_WE.GetAsMatrix4(), STILL)


def test_noise_has_the_declared_spread_about_and_along_each_axis_and_is_white():
    """2000 samples: the spread is known to 1.6 %, a mean to 2.2 % of it, a correlation to 0.022; 4 sigma."""
    config = PoseCameraConfig(position_sigma=50e-6, orientation_sigma_deg=0.01)
    n = 2000
    X = np.array([sample.X_WE.GetAsMatrix4() for sample in each_exposure(config, n)])
    noise = pose_error(X, STILL[None]) / np.repeat([np.deg2rad(0.01), 50e-6], 3)
    np.testing.assert_allclose(noise.std(axis=0), 1.0, rtol=4.0 / np.sqrt(2 * n))
    np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=4.0 / np.sqrt(n))
    np.testing.assert_allclose(np.corrcoef(noise.T), np.eye(6), atol=4.0 / np.sqrt(n))
    for lag in range(1, 6):
        across = noise[:-lag].T @ noise[lag:] / n
        np.testing.assert_allclose(across, 0.0, atol=4.5 / np.sqrt(n))  # 36 numbers each
    np.testing.assert_allclose(np.mean(noise**4, axis=0), 3.0, atol=4.0 * np.sqrt(96.0 / n))  # normal
    rotations = X[:, :3, :3]
    np.testing.assert_allclose(
        rotations @ np.swapaxes(rotations, 1, 2), np.broadcast_to(np.eye(3), (n, 3, 3)), atol=1e-12
    )


def test_the_seed_decides_the_noise():
    config = PoseCameraConfig(position_sigma=50e-6, orientation_sigma_deg=0.01, dropout_probability=0.2)
    once, again, other = (
        np.array([[*s.X_WE.GetAsMatrix34().ravel(), s.valid] for s in each_exposure(config, 50, seed)])
        for seed in (7, 7, 8)
    )
    np.testing.assert_array_equal(once, again)
    assert not np.isclose(once, other, rtol=0.0, atol=1e-9).all(axis=1).any()


@pytest.mark.parametrize("probability", [0.02, 0.3])
def test_samples_are_lost_with_the_declared_probability(probability: float):
    n = 2000
    lost = sum(
        not sample.valid for sample in each_exposure(PoseCameraConfig(dropout_probability=probability), n)
    )
    assert abs(lost - n * probability) < 4.0 * np.sqrt(n * probability * (1.0 - probability))


def test_exposures_in_a_window_are_lost_and_arrive_as_invalid():
    config = PoseCameraConfig(dropouts=[[0.02, 0.04], [0.1, 0.108]])
    found = each_exposure(config, 40)
    lost = [round(sample.time / config.period) for sample in found if not sample.valid]
    assert lost == [5, 6, 7, 8, 9, 25, 26]
    assert [round(sample.time / config.period) for sample in found] == list(range(40))


def test_a_clock_of_its_own_changes_stamps_and_nothing_else():
    config = PoseCameraConfig(clock_offset=-3e-3, clock_drift_ppm=500.0)
    true, found = each_exposure(PoseCameraConfig(), 20), each_exposure(config, 20)
    stamps = np.array([[a.time, b.time] for a, b in zip(true, found, strict=True)])
    np.testing.assert_allclose(stamps[:, 1], 1.0005 * stamps[:, 0] - 3e-3, atol=1e-12)
    assert [sample.valid for sample in found] == [sample.valid for sample in true]


def test_reflections_are_valid_far_off_and_as_many_as_declared():
    """2000 samples: a share of 20 % is known to 0.9 %; three sigma."""
    config = PoseCameraConfig(outlier_probability=0.2, outlier_mm=20.0, outlier_deg=2.0)
    found = each_exposure(config, 2000)
    errors = pose_error(STILL, np.array([sample.X_WE.GetAsMatrix4() for sample in found]))
    is_off = np.abs(errors).max(axis=1) > 1e-12
    assert all(sample.valid for sample in found)
    assert is_off.mean() == pytest.approx(0.2, abs=0.027)
    assert 1e3 * errors[is_off, 3:].std() == pytest.approx(20.0, rel=0.1)
    assert np.rad2deg(errors[is_off, :3]).std() == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"period": 0.0}, "period must be positive, got 0.0 s"),
        ({"delay": -1e-3}, "delay must not be negative, got -0.001 s"),
        (
            {"position_sigma": -1.0},
            "position_sigma and orientation_sigma_deg must not be negative, got -1.0 m",
        ),
        ({"orientation_sigma_deg": np.nan}, "must not be negative, got .* nan deg"),
        ({"dropout_probability": 1.0}, r"dropout_probability must be in \[0, 1\), got 1.0"),
        ({"dropouts": [[0.2, 0.1]]}, r"start < end, got \[0.2, 0.1\]"),
        ({"dropouts": [[0.2]]}, r"must be \[start, end\]"),
    ],
)
def test_refuses_what_no_camera_can_be(change: dict, message: str):
    with pytest.raises(ValueError, match=f"camera: .*{message}"):
        PoseCamera(PoseCameraConfig(**change))
