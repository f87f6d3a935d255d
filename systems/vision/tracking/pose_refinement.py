"""The maximum-likelihood pose given all pixels of all cameras, by Gauss-Newton steps.

Triangulation and singular value decomposition treat points as equally good in all directions. The pixels
know better: their errors are alike, and the pose with the least squared errors in the images reaches the
Cramer-Rao bound sigma^2 (J^T J)^-1.

The steps are written here because a tracker makes two or three of them in every frame and needs the
information matrix of the last one for its covariance; that they converged is checked.
"""

import math
from dataclasses import dataclass

import numpy as np

from robots.metrology.least_squares import UndeterminedError
from systems.vision import kernels
from systems.vision.camera_model import Cameras

_STEPS = 20
_CONVERGED = 1e-6  # m and rad; a step of this size leaves an error of its square
_LEAST_INFORMATION = 1.0  # px^2 per m^2 or rad^2; below, one px moves the pose by more than 1 m or 1 rad


@dataclass(frozen=True)
class PixelFit:
    """A pose from pixels. The covariance is as in `systems.vision.body_pose.BodyPose`."""

    X_WE: np.ndarray  # homogeneous matrix (4, 4)
    cofactor: np.ndarray  # the covariance for pixels with a standard deviation of one px, (6, 6)
    sigma: float  # px, standard deviation of a pixel as the residuals show it
    count: int  # of the pixels (u, v) that were used


def refine_pose(
    cameras: Cameras, p_E: np.ndarray, pixels: np.ndarray, X_WE: np.ndarray, share: np.ndarray | None = None
) -> PixelFit:
    """Gauss-Newton steps from a pose that is known well enough.

    Args:
        cameras: n cameras.
        p_E: markers in the tool's frame in m, shape (m, 3).
        pixels: where they were seen, shape (n, m, 2), NaN where they were not; behind them those of the
            blobs of ``share``, (n, m + s, 2).
        X_WE: where to begin, homogeneous matrix (4, 4).
        share: what markers have in the middles of s blobs that show more than one, (n, s, m), as
            `systems.vision.tracking.marker_images.shared_images` says; None for no such blobs.

    Raises:
        UndeterminedError: if the pixels do not determine the pose, or the steps lead nowhere.
    """
    for _ in range(_STEPS):
        predicted, J = linearize(cameras, p_E, X_WE)
        if share is not None and share.size:
            predicted = np.concatenate([predicted, shared(predicted, share)], 1)
            J = np.concatenate([J, shared(J, share)], 1)
        step, fit = gauss_newton_step(predicted, J, pixels, X_WE)
        X_WE = fit.X_WE
        if np.abs(step).max() < _CONVERGED:
            return fit
    raise UndeterminedError("the pose from pixels did not converge: the first guess is too far off")


def linearize(cameras: Cameras, p_E: np.ndarray, X_WE: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of the markers at a pose (n, m, 2), and how they move with it (n, m, 2, 6).

    A small motion is a rotation vector in rad about the axes of the world through the tool's origin, then a
    translation in m.
    """
    p_E, X_WE = np.ascontiguousarray(p_E, dtype=float), np.ascontiguousarray(X_WE)
    return kernels.frames.linearize(*cameras.arrays, p_E, X_WE)


def shared(of_markers: np.ndarray, share: np.ndarray) -> np.ndarray:
    """What holds for the middles of shared blobs: their share of what holds for the markers, (n, m, ...).

    A row of ``share``, (n, s, m), that is zero gives NaN. The result has the shape (n, s, ...).
    """
    n, m = of_markers.shape[:2]
    mean = kernels.frames.weighted(of_markers.reshape(n, m, -1), share)
    return mean.reshape(n, -1, *of_markers.shape[2:])


def gauss_newton_step(
    predicted: np.ndarray, J: np.ndarray, pixels: np.ndarray, X_WE: np.ndarray
) -> tuple[np.ndarray, PixelFit]:
    """One step, (rotation in rad, translation in m), and the fit after it, to first order.

    Raises:
        UndeterminedError: if the pixels do not determine the pose.
    """
    information, right, count = kernels.frames.normal_equations(predicted, J, pixels)
    if count < 3:
        raise UndeterminedError(f"a pose takes at least three pixels, got {count}")
    least = np.linalg.eigvalsh(information)[0]
    if not least > _LEAST_INFORMATION:
        raise UndeterminedError("the pixels leave a direction of the pose free")
    cofactor = np.linalg.inv(information)
    step = cofactor @ right
    left = kernels.frames.squared_residual(predicted, J, pixels, step)
    sigma = float(np.sqrt(left / max(2 * count - 6, 1)))
    return step, PixelFit(moved(X_WE, step), cofactor, sigma, count)


def moved(X_WE: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """A pose (4, 4) after a small motion (6,): a turn about its origin, then a shift, both in the world."""
    x, y, z = motion[:3].tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 * angle
    s = math.sin(half) / angle if angle > 0.0 else 0.5
    w, x, y, z = math.cos(half), s * x, s * y, s * z
    R = np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
    X = X_WE.copy()
    R = R @ X_WE[:3, :3]
    X[:3, :3] = 1.5 * R - 0.5 * R @ (R.T @ R)  # rounding must not add up from frame to frame
    X[:3, 3] += motion[3:]
    return X
