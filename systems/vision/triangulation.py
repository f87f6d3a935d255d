"""Points in space from their pixels in two or more cameras, all points at once."""

from dataclasses import dataclass

import numpy as np

from systems.vision.camera_model import Cameras

_STEPS = 10
_CONVERGED = 1e-12  # m, change of a point


@dataclass(frozen=True)
class Triangulation:
    """k points; NaN where fewer than two cameras saw one, or where their rays do not determine it."""

    p_W: np.ndarray  # m, (k, 3)
    covariance: np.ndarray  # m^2, (k, 3, 3)
    residual: np.ndarray  # px, root mean square over the cameras that saw it, (k,)


def triangulate(cameras: Cameras, pixels: np.ndarray, sigma: float) -> Triangulation:
    """Points by iterative reweighting, Probst (2024) eqs. (3.13) to (3.16), and their covariance.

    The weights 1/depth^2 turn the algebraic errors into distances in the images. The covariance is that of
    the distances in the images of real lenses, sigma^2 (J^T J)^-1.

    Args:
        cameras: n cameras.
        pixels: of k points as the lenses show them, shape (n, k, 2); NaN where a camera does not see one.
        sigma: standard deviation of a pixel along u and v.
    """
    p_W = triangulate_reweighted(cameras.projections, cameras.undistort(pixels))
    expected, J = cameras.project_with_jacobian(p_W)
    error = pixels - expected
    seen = ~np.isnan(error[..., 0])
    count = seen.sum(0)
    error, J = np.where(seen[..., None], error, 0.0), np.where(seen[..., None, None], J, 0.0)
    information = np.einsum("nkai,nkaj->kij", J, J)
    lost = np.isnan(p_W[:, 0]) | (count < 2)
    information[lost] = np.nan
    residual = np.sqrt(np.sum(error**2, axis=(0, 2)) / np.maximum(count, 1))
    return Triangulation(
        np.where(lost[:, None], np.nan, p_W),
        sigma**2 * np.linalg.inv(information),
        np.where(lost, np.nan, residual),
    )


def triangulate_reweighted(P: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Points by iterative reweighting from projection matrices.

    Args:
        P: projection matrices, shape (n, 3, 4).
        pixels: undistorted, shape (n, k, 2), NaN where a camera does not see the point.

    Returns:
        Points in m, shape (k, 3); NaN where fewer than two cameras see one.
    """
    A = _equations(P, pixels)  # (k, n, 2, 4)
    enough = (A.any((2, 3))).sum(1) >= 2
    p_W = np.full((len(A), 3), np.nan)
    A, at = A[enough], np.flatnonzero(enough)
    weight = np.ones(A.shape[:2])
    now = np.zeros((len(A), 3))
    for _ in range(_STEPS):
        weighted = A * weight[:, :, None, None]
        normal = np.einsum("knai,knaj->kij", weighted, A)
        before, now = now, _solve(normal[:, :3, :3], -normal[:, :3, 3])
        if not (np.abs(now - before) > _CONVERGED).any():
            break
        depth = now @ P[:, 2, :3].T + P[:, 2, 3]
        weight = 1.0 / (depth * depth)
    p_W[at] = now
    return p_W


def triangulate_linear(P: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Points by one singular value decomposition each, Probst (2024) eq. (3.12), homogeneous and unweighted.

    Faster than reweighting and less exact. Arguments and result are those of `triangulate_reweighted`.
    """
    A = _equations(P, pixels)
    enough = (A.any((2, 3))).sum(1) >= 2
    p_W = np.full((len(A), 3), np.nan)
    Vt = np.linalg.svd(A[enough].reshape(-1, 2 * len(P), 4))[2]
    p_W[enough] = Vt[:, 3, :3] / Vt[:, 3, 3:]
    return p_W


def _equations(P: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """The rows u p_3 - p_1 and v p_3 - p_2 of Probst (2024) eq. (3.11), zero where nothing is seen."""
    A = pixels.swapaxes(0, 1)[..., None] * P[:, None, 2] - P[:, :2]
    return np.where(np.any(np.isnan(pixels), -1).T[:, :, None, None], 0.0, A)


def _solve(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions of k systems of three equations; NaN where the rays are parallel."""
    scale = np.maximum(np.einsum("kii->k", normal), np.finfo(float).tiny)[:, None, None]
    singular = np.linalg.det(normal / scale) < 1e-14
    solution = np.linalg.solve(np.where(singular[:, None, None], np.eye(3), normal), right[..., None])[..., 0]
    solution[singular] = np.nan
    return solution
