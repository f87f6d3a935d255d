"""The pose of a rigid body from its marker positions, by singular value decomposition."""

from dataclasses import dataclass

import numpy as np

from robots.metrology.least_squares import UndeterminedError

MINIMUM_MARKERS = 3
MINIMUM_WIDTH = 0.02  # of a set of points across its longest direction, relative to it


@dataclass(frozen=True)
class BodyPose:
    """A pose estimate with its covariance.

    The covariance belongs to (rotation vector in rad, translation in m) in the world: the true pose is
    exp(rotation~) R_WE, p_WE + translation.
    """

    X_WE: np.ndarray  # homogeneous matrix (4, 4)
    covariance: np.ndarray  # (6, 6)
    residual: np.ndarray  # measured minus fitted points in m, in the world, (k, 3)

    @property
    def rms(self) -> float:
        """Root mean square of the distances between measured and fitted points in m."""
        return float(np.sqrt(np.mean(np.sum(self.residual**2, axis=1))))


def body_pose(p_E: np.ndarray, p_W: np.ndarray, covariance: np.ndarray) -> BodyPose:
    """The weighted best fit of the markers to their measured positions, Probst (2024) eqs. (3.24) to (3.27).

    In the source, C is printed with the scalar r_I^T r_K in place of the matrix r_I r_K^T. The weights are
    one over the mean variances of the points; the covariance of the pose takes the whole covariances.

    Args:
        p_E: markers in the body in m, shape (k, 3).
        p_W: the same markers as seen in m, shape (k, 3).
        covariance: of p_W in m^2, shape (k, 3, 3).

    Raises:
        UndeterminedError: if there are fewer than three markers or they lie on a line.
    """
    if len(p_E) < MINIMUM_MARKERS:
        raise UndeterminedError(f"a pose takes at least {MINIMUM_MARKERS} markers, got {len(p_E)}")
    if collinear(p_E):
        raise UndeterminedError(
            f"the {len(p_E)} markers are collinear, must be {MINIMUM_WIDTH:g} times as wide as long or more"
        )
    variance = np.einsum("kii->k", covariance) / 3.0
    if not np.all(variance > 0.0):  # points without noise
        variance = np.ones(len(p_E))
    R, p = fit_poses(p_E[None], p_W[None], (1.0 / variance)[None])
    X_WE = np.eye(4)
    X_WE[:3, :3], X_WE[:3, 3] = R[0], p[0]
    arm = p_E @ R[0].T
    G = np.concatenate([-_cross_matrices(arm), np.broadcast_to(np.eye(3), (len(arm), 3, 3))], -1)
    gain = np.linalg.solve(np.einsum("k,kai,kaj->ij", 1.0 / variance, G, G), np.eye(6))
    spread = np.einsum("k,kai,kab,kbj->ij", 1.0 / variance**2, G, covariance, G, optimize=True)
    return BodyPose(X_WE, gain @ spread @ gain, p_W - arm - p[0])


def fit_poses(p_E: np.ndarray, p_W: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares poses of h sets of k points at once, without checks.

    Args:
        p_E, p_W: the points in the body and in the world in m, shape (h, k, 3).
        weights: shape (h, k); zero leaves a point out.

    Returns:
        Rotations (h, 3, 3) and translations (h, 3).
    """
    share = (weights / weights.sum(1, keepdims=True))[..., None]
    middle_E, middle_W = (share * p_E).sum(1), (share * p_W).sum(1)
    C = (share * (p_W - middle_W[:, None])).swapaxes(1, 2) @ (p_E - middle_E[:, None])
    U, _, Vt = np.linalg.svd(C)
    U[:, :, 2] *= np.sign(np.linalg.det(U) * np.linalg.det(Vt))[:, None]
    R = U @ Vt
    return R, middle_W - (R @ middle_E[..., None])[..., 0]


def collinear(points: np.ndarray) -> bool:
    """Whether points (k, 3) lie on a line, or nearly so."""
    widths = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return not widths[1] > MINIMUM_WIDTH * widths[0]


def _cross_matrices(v: np.ndarray) -> np.ndarray:
    """Matrices v~ with v~ a = v x a, shape (k, 3, 3)."""
    return np.cross(v[:, None, :], np.eye(3)).swapaxes(-1, -2)
