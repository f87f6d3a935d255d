"""Which marker of a body is not where it was: a bent arm, or a sphere that is gone.

A marker that has moved pulls the pose along and leaves residuals at all others, so the largest residual need
not be its own. Each marker is tried as the only one that has moved, its displacement beside the pose; the one
that explains most of the residuals is named, if what it leaves is noise.
"""

from dataclasses import dataclass

import numpy as np

from systems.vision.camera_model import Cameras
from systems.vision.tracking.pose_refinement import linearize

_ALARM = 30.0  # by which a displacement must lower the sum of squares; noise does it with p = 1.4e-6
_ENOUGH = 0.7  # of the excess of the sum of squares, that one marker must explain


@dataclass(frozen=True)
class MarkerChange:
    """One marker that is not where it was."""

    marker: int  # from zero
    displacement: np.ndarray  # (3,) m, in the frame of the tool; NaN for a sphere that is not seen
    sigma: float  # m, the largest standard deviation of the displacement

    @property
    def is_lost(self) -> bool:
        """Whether no camera sees it any more."""
        return bool(np.isnan(self.displacement).any())

    @property
    def size(self) -> float:
        """Of the displacement in m."""
        return float(np.linalg.norm(self.displacement))


@dataclass(frozen=True)
class BodyCheck:
    """What residuals say of a body."""

    changes: list[MarkerChange]  # lost markers, then one that has moved
    misfit: float  # standard deviations by which the residuals are larger than noise


def check_markers(
    cameras: Cameras,
    p_E: np.ndarray,
    X_WE: np.ndarray,
    pixels: np.ndarray,
    pixel_sigma: float,
    expected: np.ndarray,
) -> BodyCheck:
    """Markers that are lost, one that has moved if it explains the residuals, and how well all of them fit.

    Args:
        cameras: n cameras as they were calibrated.
        p_E: the m markers as they were measured on the body, (m, 3) in m.
        X_WE: poses of the body by all markers, (k, 4, 4).
        pixels: mean images of the markers at these poses, (k, n, m, 2); NaN where one is not seen.
        pixel_sigma: standard deviation of such a mean in px.
        expected: which markers each camera should see, (k, n, m) bool.

    Raises:
        ValueError: if the standard deviation is not positive.
    """
    if not pixel_sigma > 0.0:
        raise ValueError(f"markers: pixel_sigma must be positive, got {pixel_sigma} px")
    seen = expected & np.isfinite(pixels).all(axis=3)
    lost = expected.any(axis=(0, 1)) & ~seen.any(axis=(0, 1))
    changes = [MarkerChange(int(i), np.full(3, np.nan), np.nan) for i in np.flatnonzero(lost)]
    normal, moment, squares, count = _equations(cameras, p_E, X_WE, pixels, seen, pixel_sigma)
    excess = squares - count
    gains = np.array([_gain(normal[i], moment[i]) for i in range(len(p_E))])
    best = int(np.argmax(gains))
    if gains[best] > _ALARM and gains[best] > _ENOUGH * excess:
        covariance = np.linalg.inv(normal[best])
        sigma = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
        changes.append(MarkerChange(best, covariance @ moment[best], sigma))
    return BodyCheck(changes, excess / np.sqrt(2.0 * max(count, 1)))


def _equations(
    cameras: Cameras,
    p_E: np.ndarray,
    X_WE: np.ndarray,
    pixels: np.ndarray,
    seen: np.ndarray,
    pixel_sigma: float,
) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Normal equations of each marker's displacement with the poses eliminated, and what the poses leave.

    Returns:
        Matrices (m, 3, 3) and right-hand sides (m, 3), the sum of squares in units of the noise, and how many
        degrees of freedom it has.
    """
    m = len(p_E)
    normal, moment, squares, count = np.zeros((m, 3, 3)), np.zeros((m, 3)), 0.0, 0
    for X, image, visible in zip(X_WE, pixels, seen, strict=True):
        predicted, J = linearize(cameras, p_E, X)
        visible = visible & np.isfinite(J).all(axis=(2, 3))
        if 2 * visible.sum() <= 6:
            continue
        rows = J[visible].reshape(-1, 6) / pixel_sigma
        residual = (image - predicted)[visible].ravel() / pixel_sigma
        projector = np.linalg.qr(rows)[0]
        left = residual - projector @ (projector.T @ residual)
        squares, count = squares + float(left @ left), count + len(left) - 6
        owner = np.repeat(np.nonzero(visible)[1], 2)
        by_place = rows[:, 3:] @ X[:3, :3]  # by a displacement in the frame of the tool
        for i in range(m):
            own = np.where((owner == i)[:, None], by_place, 0.0)
            own = own - projector @ (projector.T @ own)
            normal[i] += own.T @ own
            moment[i] += own.T @ left
    return normal, moment, squares, count


def _gain(normal: np.ndarray, moment: np.ndarray) -> float:
    """By how much a displacement lowers the sum of squares."""
    if np.linalg.cond(normal) > 1e10:
        return 0.0
    return float(moment @ np.linalg.solve(normal, moment))
