"""Epipolar geometry between pairs of cameras."""

import numpy as np

from systems.vision.camera_model import Cameras


def fundamental_matrices(cameras: Cameras) -> np.ndarray:
    """F[i, j] with x_j^T F[i, j] x_i = 0 for undistorted pixels x = (u, v, 1) of the same point.

    Probst (2024) eq. (3.19), F = K'^-T t~ R K^-1 with the rotation R from camera i into j and the position t
    of i seen by j. In eq. (3.20) the vector from C to C' stands in the frame C, not C' as printed.

    Returns:
        Shape (n, n, 3, 3); zero for i = j.
    """
    K_inverse = np.linalg.inv(cameras.intrinsics)
    between = cameras.p_WC[:, None] - cameras.p_WC  # from j to i in the world, (i, j, 3)
    x, y, z = np.moveaxis(np.einsum("jab,ijb->ija", cameras.R_CW, between), -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*x.shape, 3, 3)
    R = cameras.R_CW[None] @ cameras.R_WC[:, None]
    return K_inverse.swapaxes(1, 2)[None] @ cross @ R @ K_inverse[:, None]


def epipolar_lines(F: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """The lines l = F x of Probst (2024) eq. (3.21), scaled so that l^T x is a distance in px.

    Args:
        F: fundamental matrices, shape (..., 3, 3).
        pixels: undistorted, of the camera that F comes from, shape (..., k, 2).

    Returns:
        Shape (..., k, 3).
    """
    lines = homogeneous(pixels) @ F.swapaxes(-1, -2)
    return lines / np.linalg.norm(lines[..., :2], axis=-1, keepdims=True)


def epipolar_distances(F: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Distances of pairs of pixels from satisfying the epipolar constraint.

    Args:
        F: from the first to the second camera, shape (..., 3, 3).
        first: undistorted pixels of the first camera, shape (..., k, 2).
        second: undistorted pixels of the second camera, shape (..., l, 2).

    Returns:
        The larger of the two distances in px from a pixel to the line of the other, shape (..., k, l).
    """
    in_second = epipolar_lines(F, first) @ homogeneous(second).swapaxes(-1, -2)
    in_first = homogeneous(first) @ epipolar_lines(F.swapaxes(-1, -2), second).swapaxes(-1, -2)
    return np.maximum(np.abs(in_second), np.abs(in_first))


def homogeneous(pixels: np.ndarray) -> np.ndarray:
    """(u, v) to (u, v, 1), shape (..., 3)."""
    return np.concatenate([pixels, np.ones_like(pixels[..., :1])], -1)
