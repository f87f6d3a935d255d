"""Direct linear transformation: a camera from known points, as the initial guess of the refinement."""

import numpy as np
from scipy.linalg import rq

from robots.metrology.least_squares import UndeterminedError
from systems.vision.camera_model import Cameras

MINIMUM_POINTS = 6
_FLATTEST = 0.02  # a set of points in its thinnest direction, relative to its longest


def direct_linear(p_W: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """The projection matrix that maps points to pixels, Probst (2024) eqs. (3.31) to (3.37).

    Two corrections: a block A_i of (3.33) is 2 x 12, not 12 x 2 as printed; and the eigenvector of A^T A is
    that of the smallest eigenvalue, which is zero without noise only. It is found as the last right singular
    vector of A, with points and pixels centred and scaled first, without which the result would depend on
    the choice of units.

    Args:
        p_W: points in m, shape (k, 3).
        pixels: where an ideal pinhole shows them, shape (k, 2).

    Returns:
        P up to its scale, shape (3, 4).

    Raises:
        UndeterminedError: if there are fewer than six points or they lie in a plane.
    """
    if len(p_W) < MINIMUM_POINTS:
        raise UndeterminedError(f"a camera takes at least {MINIMUM_POINTS} known points, got {len(p_W)}")
    widths = np.linalg.svd(p_W - p_W.mean(0), compute_uv=False)
    if not widths[2] > _FLATTEST * widths[0]:
        raise UndeterminedError(
            f"the {len(p_W)} known points lie in a plane, must be {_FLATTEST:g} times as thick as long"
        )
    T, U = _normalization(p_W), _normalization(pixels)
    points = p_W * T[0, 0] + T[:-1, -1]
    u, v = (pixels * U[0, 0] + U[:-1, -1]).T
    row, nothing = np.hstack([points, np.ones((len(points), 1))]), np.zeros((len(points), 4))
    A = np.vstack(
        [np.hstack([row, nothing, -u[:, None] * row]), np.hstack([nothing, row, -v[:, None] * row])]
    )
    P = np.linalg.svd(A, full_matrices=False)[2][-1].reshape(3, 4)
    return np.linalg.inv(U) @ P @ T


def camera_from_projection(P: np.ndarray, p_W: np.ndarray) -> Cameras:
    """One camera without lens whose projection is P, but for the skew of its pixel axes, which no camera has.

    Args:
        P: projection matrix up to its scale and sign, shape (3, 4).
        p_W: points that are in front of it in m, shape (k, 3).
    """
    P = P / np.linalg.norm(P[2, :3])
    if np.mean(p_W @ P[2, :3] + P[2, 3]) < 0.0:
        P = -P
    K, R_CW = rq(P[:, :3])
    signs = np.sign(np.diag(K))
    K, R_CW = K * signs, signs[:, None] * R_CW
    if np.linalg.det(R_CW) < 0.0:
        raise UndeterminedError("the pixels are a mirror image of the points: are axes or names exchanged?")
    return Cameras(
        focal=np.array([[K[0, 0], K[1, 1]]]) / K[2, 2],
        center=K[None, :2, 2] / K[2, 2],
        radial=np.zeros((1, 3)),
        tangential=np.zeros((1, 2)),
        R_WC=R_CW.T[None],
        p_WC=-np.linalg.solve(P[:, :3], P[:, 3])[None],
    )


def _normalization(points: np.ndarray) -> np.ndarray:
    """The similarity that brings points to mean zero and mean distance one, homogeneous."""
    middle = points.mean(0)
    scale = 1.0 / np.linalg.norm(points - middle, axis=1).mean()
    T = np.diag([*np.full(points.shape[1], scale), 1.0])
    T[:-1, -1] = -scale * middle
    return T
