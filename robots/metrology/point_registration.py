"""Registration of a frame by least squares from three or more points with known coordinates in it.

K is the frame, with the nominal points p_K; D is the device that measures them. The residuals of the fit
show what three points by Gram-Schmidt cannot: how well the points were measured.
"""

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from robots.metrology.least_squares import FitStatistics, UndeterminedError, fit_statistics

MINIMUM_LENGTH = 1e-3  # m, of a set of points; a shorter one is in another unit
MINIMUM_WIDTH = 0.02  # of a set of points, across its longest direction and relative to it
SCALE_RANGE = (0.5, 2.0)  # measured size over nominal size; outside, units are mixed

_NEGLIGIBLE = 1e-9  # m, residuals that are rounding
_FLATNESS = 0.01  # thickness over length below which a set of points is taken as a plane
_MIRROR_GAIN = 0.1  # a mirror image that leaves less than this share of the squares is the better one


@dataclass(frozen=True)
class Registration:
    """A frame by least squares.

    The covariance of ``statistics`` belongs to (rotation vector in rad, translation in m), both in D: the
    true pose is exp(rotation~) R_DK, p_DK + translation. Its sigma is in m and belongs to weight one.
    """

    X_DK: RigidTransform
    residual: np.ndarray  # measured minus fitted points in m, in D, (n, 3)
    scale: float  # size of the measured set over that of the nominal one; not part of the fit
    statistics: FitStatistics

    @property
    def rms(self) -> float:
        """Root mean square of the distances between measured and fitted points in m."""
        return float(np.sqrt(np.mean(np.sum(self.residual**2, axis=1))))


def register_points(p_K: np.ndarray, p_D: np.ndarray, weights: np.ndarray | None = None) -> Registration:
    """The pose X_DK that brings nominal points p_K to measured ones p_D with the least squared distance.

    Args:
        p_K: nominal points in the frame in m, shape (n, 3), at least three.
        p_D: the same points as measured in m, shape (n, 3).
        weights: one over the variances of the points, or in proportion to that, shape (n,).

    Raises:
        UndeterminedError: if the points are too few, on one line, mirrored, or of different size.
        ValueError: if shapes disagree or a weight is not positive.
    """
    p_K, p_D = np.asarray(p_K, dtype=float), np.asarray(p_D, dtype=float)
    if p_K.shape != p_D.shape or p_K.shape[1:] != (3,):
        raise ValueError(f"points must have the same shape (n, 3), got {p_K.shape} and {p_D.shape}")
    weights = np.ones(len(p_K)) if weights is None else np.asarray(weights, dtype=float)
    if weights.shape != (len(p_K),) or not np.all(weights > 0.0):
        raise ValueError(f"weights must be {len(p_K)} positive numbers, got {weights.tolist()}")
    if len(p_K) < 3:
        raise UndeterminedError(f"a registration takes at least three points, got {len(p_K)}")
    share = weights / weights.sum()
    center_K, center_D = share @ p_K, share @ p_D
    from_center_K, from_center_D = p_K - center_K, p_D - center_D
    _refuse_a_line(from_center_K, "nominal")
    _refuse_a_line(from_center_D, "measured")
    scale = float(np.sqrt(share @ np.sum(from_center_D**2, 1) / (share @ np.sum(from_center_K**2, 1))))
    if not SCALE_RANGE[0] < scale < SCALE_RANGE[1]:
        raise UndeterminedError(
            f"the measured points are {scale:.4g} times as far apart as the nominal ones (are units mixed?)"
        )
    _refuse_a_mirror(from_center_K, from_center_D, share)
    R = Rotation.align_vectors(from_center_D, from_center_K, weights=weights)[0].as_matrix()
    X_DK = RigidTransform(RotationMatrix(RotationMatrix.ProjectToRotationMatrix(R)), center_D - R @ center_K)
    arms = p_K @ R.T
    residual = p_D - arms - X_DK.translation()
    jacobian = np.concatenate([-_cross_matrices(arms), np.broadcast_to(np.eye(3), (len(arms), 3, 3))], -1)
    root = np.sqrt(weights)
    statistics = fit_statistics(
        root[:, None, None] * jacobian, root[:, None] * residual, _NEGLIGIBLE * float(root.max())
    )
    return Registration(X_DK, residual, scale, statistics)


def _refuse_a_line(from_center: np.ndarray, name: str) -> None:
    lengths = np.linalg.svd(from_center, compute_uv=False)
    if lengths[0] < MINIMUM_LENGTH:
        raise UndeterminedError(f"the {name} points coincide (is the unit right?)")
    if lengths[1] < MINIMUM_WIDTH * lengths[0]:
        raise UndeterminedError(
            f"the {name} points are collinear: {lengths[1] / lengths[0]:.2g} times as wide as long, "
            f"must be at least {MINIMUM_WIDTH:g}"
        )


def _refuse_a_mirror(from_center_K: np.ndarray, from_center_D: np.ndarray, share: np.ndarray) -> None:
    """A plane fits its mirror image as well as itself; a solid set of points does not."""
    thickness, length = np.linalg.svd(from_center_K, compute_uv=False)[[2, 0]]
    U, s, Vt = np.linalg.svd((share[:, None] * from_center_D).T @ from_center_K)
    if np.linalg.det(U @ Vt) > 0.0 or thickness < _FLATNESS * length:
        return
    size = share @ np.sum(from_center_K**2 + from_center_D**2, axis=1)
    rotated, mirrored = size - 2.0 * (s[0] + s[1] - s[2]), size - 2.0 * s.sum()
    if max(mirrored, 0.0) < _MIRROR_GAIN * rotated:
        raise UndeterminedError(
            f"left-handed: the measured points are a mirror image of the nominal ones, which fits to "
            f"{1e3 * np.sqrt(max(mirrored, 0.0)):.3g} mm instead of {1e3 * np.sqrt(rotated):.3g} mm "
            "(is an axis reversed or are two exchanged?)"
        )


def _cross_matrices(v: np.ndarray) -> np.ndarray:
    """Matrices v~ with v~ a = v x a, shape (n, 3, 3)."""
    return np.cross(v[:, None, :], np.eye(3)).swapaxes(-1, -2)
