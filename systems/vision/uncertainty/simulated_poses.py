"""Poses as they would be measured with errors drawn at random: every cause acts, nothing is linearised."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from robots.pose import pose_error
from systems.vision.camera_model import Cameras
from systems.vision.tracking.pose_refinement import linearize
from systems.vision.uncertainty.pose_uncertainty import MeasuredPose, Uncertainties

_STEPS = 2  # of Gauss and Newton from the true pose; the second changes it by nothing that counts


def simulated_errors(
    cameras: Cameras,
    p_E: np.ndarray,
    anchor_W: np.ndarray,
    pose: MeasuredPose,
    given: Uncertainties,
    draws: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Errors of a measured pose, (draws, 6): rotation vector in rad and translation in m.

    Images are taken by cameras that stand where they truly are and of a body that has truly grown, and the
    pose is the best fit with what is believed. Other arguments as of
    `systems.vision.uncertainty.pose_uncertainty.covariances`.
    """
    errors, n = np.empty((draws, 6)), len(cameras)
    for k in range(draws):
        warmer = given.temperature * rng.uniform(-1.0, 1.0)
        shift = given.camera_position * rng.standard_normal((n, 3))
        shift += given.frame_expansion * warmer * (cameras.p_WC - anchor_W)
        turn = Rotation.from_rotvec(given.camera_rotation * rng.standard_normal((n, 3)))
        true = replace(cameras, R_WC=turn.as_matrix() @ cameras.R_WC, p_WC=cameras.p_WC + shift)
        body = p_E * (1.0 + given.body_expansion * warmer)
        late = given.time_stamp * rng.standard_normal()
        X = _moved(pose.X_WE, late * pose.V_WE)
        images = true.project(body @ X[:3, :3].T + X[:3, 3])
        images = images + given.pixel * rng.standard_normal(images.shape)
        fitted = _fitted(cameras, p_E, X, images, pose.seen)
        tool = np.eye(4)
        tool[:3, :3] = Rotation.from_rotvec(given.tool_rotation * rng.standard_normal(3)).as_matrix()
        tool[:3, 3] = given.tool_position * rng.standard_normal(3)
        errors[k] = pose_error(fitted @ tool, pose.X_WE)
    return errors


def _moved(X: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """A pose (4, 4) after a rotation vector in rad about axes of the world through it, and a shift in m."""
    Y = X.copy()
    Y[:3, :3] = Rotation.from_rotvec(motion[:3]).as_matrix() @ X[:3, :3]
    Y[:3, 3] += motion[3:]
    return Y


def _fitted(
    cameras: Cameras, p_E: np.ndarray, X: np.ndarray, images: np.ndarray, seen: np.ndarray
) -> np.ndarray:
    """The pose with the least squares of the images' residuals, beginning at X."""
    for _ in range(_STEPS):
        predicted, J = linearize(cameras, p_E, X)
        step = np.linalg.lstsq(J[seen].reshape(-1, 6), (images - predicted)[seen].ravel(), rcond=None)[0]
        X = _moved(X, step)
    return X
