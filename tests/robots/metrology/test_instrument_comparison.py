"""A second instrument is found in time and space, and the one of the two that is wrong is named."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from scipy.spatial.transform import Rotation

from robots.metrology.instrument_comparison import Followed, fitted, share_of_first
from robots.metrology.time_alignment import AlignmentError

LAG, OFFSET = 0.137, np.array([0.02, -0.03, 0.05])  # s, m
X_12 = RigidTransform(RollPitchYaw(0.4, -0.3, 1.2), [2.0, -0.8, 0.5])
TIME = np.arange(0.0, 12.0, 4e-3)


def way(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rotations of a tool on a closed way that never repeats its speeds."""
    p = np.column_stack(
        [0.6 + 0.2 * np.sin(0.9 * time), 0.2 * np.cos(1.3 * time), 0.5 + 0.1 * np.sin(2.1 * time)]
    )
    turns = np.column_stack([0.5 * np.sin(0.7 * time), 0.4 * np.cos(1.1 * time), 0.3 * np.sin(time)])
    return p, Rotation.from_rotvec(turns).as_matrix()


def wave(time: np.ndarray, size: float, rate: float) -> np.ndarray:
    return size * np.column_stack(
        [np.sin(rate * time), np.cos(1.3 * rate * time), np.sin(0.7 * rate * time + 1.0)]
    )


def camera(error: float = 0.0) -> Followed:
    p, R = way(TIME)
    noise = 2e-5 * np.random.default_rng(1).standard_normal(p.shape)
    return Followed(TIME, p + noise + wave(TIME, error, 4.0), R)


def tracker(error: float = 0.0) -> Followed:
    """At 1 kHz, late by its clock, in its own frame, of a target beside the tool."""
    time = np.arange(0.5, 11.0, 1e-3)
    p, R = way(time)
    seen = (p + R @ OFFSET + wave(time, error, 5.3) - X_12.translation()) @ X_12.rotation().matrix()
    return Followed(time + LAG, seen + 5e-6 * np.random.default_rng(2).standard_normal(p.shape))


def joints() -> Followed:
    """By the robot's own kinematics, which is off by more than both."""
    p, R = way(TIME)
    return Followed(TIME, p + wave(TIME, 3e-4, 1.7), R)


def test_clock_frame_and_target_of_the_second_are_found():
    """What is left is the noise of both, 35 micrometres in space."""
    found = fitted(camera(), tracker())
    assert found.lag == pytest.approx(LAG, abs=2e-5)
    np.testing.assert_allclose(found.offset, OFFSET, atol=1e-5)
    np.testing.assert_allclose(found.X_12.GetAsMatrix4(), X_12.GetAsMatrix4(), atol=3e-5)
    assert found.rms == pytest.approx(np.sqrt(3.0) * 2e-5, rel=0.1)


@pytest.mark.parametrize(
    ("of_camera", "of_tracker", "culprit"),
    [(2e-4, 0.0, "first"), (0.0, 2e-4, "second"), (2e-4, 2e-4, "both")],
)
def test_the_one_that_is_wrong_is_named(of_camera: float, of_tracker: float, culprit: str):
    first = camera(of_camera)
    second, third = fitted(first, tracker(of_tracker)), fitted(first, joints())
    share = share_of_first(second, third)
    assert share.culprit == culprit
    expected = {"first": 1.0, "second": 0.0, "both": 0.5}[culprit]
    assert abs(share.first - expected) < 4.0 * share.sigma + 0.05


def test_recordings_of_two_motions_are_refused():
    other = Followed(
        tracker().time, tracker().position[::-1] * [1.0, 0.2, 3.0] + wave(tracker().time, 0.3, 9.0)
    )
    with pytest.raises(AlignmentError, match="no lag within"):
        fitted(camera(), other)
    with pytest.raises(AlignmentError, match=r"have 0\.00 s in common"):
        fitted(camera(), Followed(tracker().time + 1e5, tracker().position))
