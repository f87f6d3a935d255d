"""Blob detection: connected bright regions that look like a sphere, and their centroids.

Pixels above a threshold are put together to components. The middle of a component is the mean of
its pixels weighted by brightness, Probst (2024) eq. (3.41), corrected: the factors 1/K and 1/J in front of
the sums do not belong there, and the weight is what a pixel is brighter than the threshold. Weighted with
all of its brightness, a pixel at the edge would count for much or not at all, as noise decides; so it counts
for nothing at the moment when it drops out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from systems.vision import kernels
from systems.vision.camera_model import Cameras
from systems.vision.rendering import FULL_SCALE, Picture
from systems.vision.sphere_images import sphere_centers

_MOST_PIECES = 32_767  # of components; more than that are no picture of markers


@dataclass
class CentroidConfig:
    """Thresholds for a marker in an image; read from a scenario file."""

    threshold: float = 0.4  # in full scales; Probst (2024), table A.8, has 0.3 to 0.84
    smallest: int = 8  # px, of the area
    largest: int = 4000  # px, of the area
    longest: float = 1.5  # ratio of the axes of the ellipse with the same moments
    least_filled: float = 0.85  # share of that ellipse's area


def check_centroids(config: CentroidConfig) -> None:
    """Raises ValueError if a number is out of its range."""
    if not 0.0 < config.threshold < 1.0:
        raise ValueError(f"centroids: threshold must be between 0 and 1, got {config.threshold}")
    if not 0 < config.smallest <= config.largest:
        raise ValueError(
            f"centroids: smallest must be positive and at most largest, got {config.smallest} and "
            f"{config.largest} px"
        )
    if not config.longest > 1.0:
        raise ValueError(f"centroids: longest must be above 1, got {config.longest}")
    if not 0.0 <= config.least_filled < 1.0:
        raise ValueError(f"centroids: least_filled must be in [0, 1), got {config.least_filled}")


def blobs_in(pictures: Sequence[Picture], cameras: Cameras, config: CentroidConfig) -> np.ndarray:
    """Detected images of sphere centres.

    Args:
        pictures: one of each camera.
        cameras: n cameras, whose focal lengths tell how far out an ellipse of a size appears.
        config: what counts as a marker.

    Returns:
        Pixels, shape (n, b, 2), b at least one, NaN where there is none; in no order that means anything.
    """
    camera, middle, area = _markers(pictures, config)
    count = np.bincount(camera, minlength=len(pictures))
    most = max(1, int(count.max(initial=0)))
    middles, areas = np.full((len(pictures), most, 2), np.nan), np.full((len(pictures), most), np.nan)
    place = np.arange(len(camera)) - (np.cumsum(count) - count)[camera]
    middles[camera, place], areas[camera, place] = middle, area
    return sphere_centers(cameras, middles, areas)


def centroids(picture: Picture, config: CentroidConfig) -> tuple[np.ndarray, np.ndarray]:
    """Centroids (k, 2) in px of the whole image, and areas (k,) in px^2, of what looks like a marker.

    A blob at the edge of the window is left out, for it may go on behind it.
    """
    return _markers([picture], config)[1:]


def _markers(
    pictures: Sequence[Picture], config: CentroidConfig
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`centroids` of several pictures one after another, and before them which picture each is in, (k,)."""
    level = int(config.threshold * FULL_SCALE)
    found = [kernels.components.components(picture.pixels, level, _MOST_PIECES) for picture in pictures]
    weighted, plain, is_whole = (np.concatenate(parts) for parts in zip(*found, strict=True))
    area = plain[:, 0]
    is_marker = is_whole & (area >= config.smallest) & (area <= config.largest) & _is_round(plain, config)
    camera = np.repeat(np.arange(len(pictures)), [len(part) for part, _, _ in found])[is_marker]
    corner = np.array([picture.corner for picture in pictures])
    return camera, weighted[is_marker, 1:3] / weighted[is_marker, :1] + corner[camera], area[is_marker]


def _is_round(sums: np.ndarray, config: CentroidConfig) -> np.ndarray:
    """Whether components are filled ellipses that are not too long, by the moments of their areas."""
    area = np.maximum(sums[:, 0], 1.0)
    u, v = sums[:, 1] / area, sums[:, 2] / area
    # A pixel is a square with moments of its own.
    uu, vv = sums[:, 3] / area - u * u + 1.0 / 12.0, sums[:, 5] / area - v * v + 1.0 / 12.0
    uv = sums[:, 4] / area - u * v
    half_trace, half_gap = 0.5 * (uu + vv), np.hypot(0.5 * (uu - vv), uv)
    small, large = half_trace - half_gap, half_trace + half_gap  # squared half axes over four
    ellipse = 4.0 * np.pi * np.sqrt(np.maximum(small * large, 0.0))
    return (large <= config.longest**2 * small) & (area >= config.least_filled * ellipse)
