"""Camera, base, flange and body: round trips, OpenCV beside it, predicted spread, degenerate motions."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from robots.metrology.hand_eye import ROTATION_SIGMA, TRANSLATION_SIGMA, align_camera, align_hand_eye
from robots.metrology.least_squares import UndeterminedError
from robots.pose import pose_error

X_FD = RigidTransform(RotationMatrix(Rotation.from_rotvec([0.2, -1.5, 0.4]).as_matrix()), [0.05, 0.03, 0.12])
X_BC = RigidTransform(RotationMatrix(Rotation.from_rotvec([2.0, 0.5, -1.0]).as_matrix()), [1.8, -0.4, 1.1])


def flange_poses(rng: np.random.Generator, count: int = 15, largest: float = 1.2) -> np.ndarray:
    X = np.tile(np.eye(4), (count, 1, 1))
    X[:, :3, :3] = Rotation.from_rotvec(rng.uniform(-largest, largest, (count, 3))).as_matrix()
    X[:, :3, 3] = rng.uniform([0.3, -0.4, 0.2], [0.6, 0.4, 0.8], (count, 3))
    return X


def seen(X_BF: np.ndarray) -> np.ndarray:
    """What an exact camera sees of the body."""
    return X_BC.inverse().GetAsMatrix4() @ X_BF @ X_FD.GetAsMatrix4()


def noisy(X: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    X = X.copy()
    turns = Rotation.from_rotvec(ROTATION_SIGMA * rng.standard_normal((len(X), 3))).as_matrix()
    X[:, :3, :3] = turns @ X[:, :3, :3]
    X[:, :3, 3] += TRANSLATION_SIGMA * rng.standard_normal((len(X), 3))
    return X


def distance(X: RigidTransform, Y: RigidTransform) -> float:
    return float(np.abs(pose_error(X.GetAsMatrix4(), Y.GetAsMatrix4())).max())


@given(st.integers(0, 2**32 - 1), st.integers(4, 12))
def test_exact_poses_give_both_offsets_exactly(seed: int, count: int):
    X_BF = flange_poses(np.random.default_rng(seed), count)
    found = align_camera(X_BF, seen(X_BF))
    assert distance(found.X_FD, X_FD) < 1e-9
    assert distance(found.X_BC, X_BC) < 1e-9


def test_a_known_offset_makes_one_pose_enough():
    """As in Probst (2024), appendix A.4: one basic position of the robot, the offset from drawings."""
    X_BF = flange_poses(np.random.default_rng(0), 1)
    assert distance(align_camera(X_BF, seen(X_BF), X_FD=X_FD).X_BC, X_BC) < 1e-12
    found = align_camera(X_BF, seen(X_BF), X_BC=X_BC)
    assert distance(found.X_FD, X_FD) < 1e-12
    assert np.isnan(found.statistics.standard_deviations[:6]).all()  # nothing shows how good it is
    assert not found.statistics.standard_deviations[6:].any()


def test_a_camera_on_the_flange_is_the_same_problem():
    X_BF = flange_poses(np.random.default_rng(1))
    X_FC, X_BT = X_FD, X_BC
    X_CT = X_FC.inverse().GetAsMatrix4() @ np.linalg.inv(X_BF) @ X_BT.GetAsMatrix4()
    found = align_hand_eye(X_BF, X_CT)
    assert distance(found.X_BC, X_FC) < 1e-9
    assert distance(found.X_FD, X_BT) < 1e-9


@pytest.mark.parametrize("method", ["SHAH", "LI"])
def test_opencv_finds_the_same_and_fits_no_better(method: str):
    rng = np.random.default_rng(2)
    X_BF = flange_poses(rng, 30)
    X_CD = noisy(seen(X_BF), rng)
    # What OpenCV calls world, camera, base and gripper is here D, C, F and B: X_CD X_DF = X_CB X_BF.
    R_DF, p_DF, R_CB, p_CB = cv2.calibrateRobotWorldHandEye(
        list(X_CD[:, :3, :3]),
        list(X_CD[:, :3, 3]),
        list(X_BF[:, :3, :3]),
        list(X_BF[:, :3, 3]),
        method=getattr(cv2, f"CALIB_ROBOT_WORLD_HAND_EYE_{method}"),
    )
    X_FD_cv, X_BC_cv = (
        RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), p.ravel()).inverse()
        for R, p in ((R_DF, p_DF), (R_CB, p_CB))
    )
    found = align_camera(X_BF, X_CD)
    # A closed form weighs rotations as it likes: a few standard deviations of what 30 poses leave.
    assert distance(found.X_FD, X_FD_cv) < 3e-4
    assert distance(found.X_BC, X_BC_cv) < 1e-3
    expected = X_BC_cv.inverse().GetAsMatrix4() @ X_BF @ X_FD_cv.GetAsMatrix4()
    sigmas = np.repeat([ROTATION_SIGMA, TRANSLATION_SIGMA], 3)
    assert np.sum((found.residual / sigmas) ** 2) < np.sum((pose_error(X_CD, expected) / sigmas) ** 2)


@pytest.mark.slow
def test_the_predicted_spread_is_the_one_that_occurs():
    rng = np.random.default_rng(3)
    X_BF = flange_poses(rng)
    errors, predicted, sigma, covered, runs = [], [], [], 0, 300
    for _ in range(runs):
        found = align_camera(X_BF, noisy(seen(X_BF), rng))
        pairs = ((X_FD, found.X_FD), (X_BC, found.X_BC))
        errors.append(np.concatenate([pose_error(a.GetAsMatrix4(), b.GetAsMatrix4()) for a, b in pairs]))
        predicted.append(found.statistics.covariance)
        sigma.append(found.statistics.sigma)
        covered += found.statistics.covers(errors[-1], slice(0, 12))
    # 300 samples know a standard deviation to 4 %, and a share of 95 % to 1.3 %; three of each.
    spread = np.sqrt(np.diag(np.mean(predicted, axis=0)))
    assert np.std(errors, axis=0) == pytest.approx(spread, rel=0.12)
    assert np.sqrt(np.mean(np.square(sigma))) == pytest.approx(1.0, rel=0.02)
    assert covered / runs == pytest.approx(0.95, abs=0.04)


def test_a_pose_that_was_taken_while_the_robot_moved_is_named():
    rng = np.random.default_rng(4)
    X_BF = flange_poses(rng)
    X_CD = noisy(seen(X_BF), rng)
    X_CD[6, :3, 3] += [0.0, 4e-3, 0.0]
    assert align_camera(X_BF, X_CD).statistics.outliers == (6,)


def about_one_axis(rng: np.random.Generator) -> np.ndarray:
    X = flange_poses(rng, 8)
    X[:, :3, :3] = Rotation.from_rotvec(np.outer(np.linspace(-1.0, 1.0, 8), [0, 1, 0])).as_matrix()
    return X


def without_turning(rng: np.random.Generator) -> np.ndarray:
    X = flange_poses(rng, 8)
    X[:, :3, :3] = X[0, :3, :3]
    return X


DEGENERATE = {
    "two poses": (lambda rng: flange_poses(rng, 2), "at least 3 poses, got 2"),
    "one axis": (about_one_axis, r"the flange turns about one axis only, \(0.00, 1.00, 0.00\)"),
    "translation": (without_turning, "orientations of the flange are too much alike"),
}


@pytest.mark.parametrize(("motion", "reason"), DEGENERATE.values(), ids=DEGENERATE.keys())
def test_a_motion_that_leaves_an_offset_unknown_is_refused_and_named(motion, reason):
    X_BF = motion(np.random.default_rng(5))
    with pytest.raises(UndeterminedError, match=reason):
        align_camera(X_BF, seen(X_BF))


def mirrored(X: np.ndarray) -> np.ndarray:
    """Orientations as a camera with a reversed y axis would report them."""
    return np.diag([1.0, -1.0, 1.0, 1.0]) @ X @ np.diag([1.0, 1.0, -1.0, 1.0])


def in_millimetres(X: np.ndarray) -> np.ndarray:
    X = X.copy()
    X[:, :3, 3] *= 1000.0
    return X


CONTRADICTIONS = {
    "other order": (lambda X: X[::-1], "rotations of flange and body do not belong together"),
    "inverse": (np.linalg.inv, "do not belong together"),
    "left-handed": (mirrored, "multiplied by -1 .*left-handed"),
    "millimetres": (in_millimetres, "if they are multiplied by 0.001"),
}


@pytest.mark.parametrize(("change", "reason"), CONTRADICTIONS.values(), ids=CONTRADICTIONS.keys())
def test_poses_that_do_not_belong_together_are_refused(change, reason):
    rng = np.random.default_rng(6)
    X_BF = flange_poses(rng)
    X_CD = change(seen(X_BF))
    with pytest.raises(UndeterminedError, match=reason):
        align_camera(X_BF, X_CD)


def test_a_body_that_only_turns_on_the_spot_is_no_mixture_of_units():
    rng = np.random.default_rng(7)
    X_BF = flange_poses(rng)
    X_BF[:, :3, 3] = [0.4, 0.1, 0.5] - X_BF[:, :3, :3] @ X_FD.translation()
    found = align_camera(X_BF, noisy(seen(X_BF), rng))
    assert distance(found.X_FD, X_FD) < 1e-3


def test_a_drawing_of_another_body_is_refused():
    X_BF = flange_poses(np.random.default_rng(9))
    with pytest.raises(UndeterminedError, match="do not belong together"):
        align_camera(X_BF, seen(X_BF), X_FD=X_BC)


def test_nonsense_is_refused():
    X = flange_poses(np.random.default_rng(8))
    with pytest.raises(ValueError, match="nothing to align"):
        align_camera(X, seen(X), X_FD, X_BC)
    with pytest.raises(ValueError, match=r"same shape \(n, 4, 4\)"):
        align_camera(X, seen(X)[1:])
    with pytest.raises(ValueError, match="sigmas must be positive, got 0"):
        align_camera(X, seen(X), rotation_sigma=0.0)
