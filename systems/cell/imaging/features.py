"""What the cameras report of the markers on the level of features: one pixel for each blob of light.

The centres of the spheres are projected; what is missing or false is decided by standard normal numbers from
outside, so that the same numbers give the same blobs. The image of a sphere is taken as centred on that of
its centre; the ellipse that a sphere off the axis really shows lies a little beside it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, pdtr

from robots.kinematics.arm_capsules import Capsules
from systems.vision.camera_model import Cameras
from systems.vision.marker_body import DetectionBody
from systems.vision.tracking.marker_images import marker_diameters, merged_images
from systems.vision.visibility import in_window, occluded

FALSE_SLOTS = 8  # false blobs that one camera can report at once
MOST_FALSE = 0.2  # per marker; with eleven markers, one time in a thousand the slots are too few


@dataclass
class FeatureConfig:
    """How well the cameras find the centres of the markers; read from a scenario file."""

    pixel_sigma: float = 0.1  # px, standard deviation of a centre along u and v
    missing: float = 0.0  # probability of a visible marker to be overlooked by one camera
    false: float = 0.0  # false blobs per marker of the body and camera, near the image of the body
    merging: bool = True  # markers whose images touch appear as one blob


class FeatureSource:
    """The blobs that n cameras see of a body with m markers."""

    def __init__(
        self, cameras: Cameras, windows: np.ndarray, body: DetectionBody, config: FeatureConfig
    ) -> None:
        """Checks the configuration.

        Args:
            cameras: n cameras.
            windows: the parts of their images that are looked at, u0, v0, u1, v1 in px, (n, 4).
            body: what carries the markers.
            config: how well they are found.

        Raises:
            ValueError: if a number is out of its range.
        """
        _check(config)
        self._cameras, self._windows, self._body, self._config = cameras, windows, body, config
        mean = config.false * len(body)
        # The number of false blobs is as many of these as the chance exceeds.
        self._false_counts = pdtr(np.arange(FALSE_SLOTS), mean)  # Poisson

    @property
    def noise_size(self) -> int:
        """Standard normal numbers for one exposure: u, v and chance of each marker, those of false blobs."""
        return len(self._cameras) * (3 * len(self._body) + 2 * FALSE_SLOTS + 1)

    @property
    def num_slots(self) -> int:
        """The number of blobs that one camera can report."""
        return len(self._body) + FALSE_SLOTS

    def blobs(self, X_WE: np.ndarray, noise: np.ndarray, arm: Capsules | None = None) -> np.ndarray:
        """One exposure.

        Args:
            X_WE: the tool in the world, homogeneous matrix (4, 4).
            noise: standard normal numbers, shape (noise_size,).
            arm: what may stand in the way; None for nothing.

        Returns:
            Pixels, shape (n, num_slots, 2), in the order of the rows of the images, then NaN: the order says
            nothing about which marker is which.
        """
        n, m, config = len(self._cameras), len(self._body), self._config
        noise = noise.reshape(n, -1)
        p_W = self._body.p_E @ X_WE[:3, :3].T + X_WE[:3, 3]
        pixels = self._cameras.project(p_W)
        seen = in_window(pixels, self._windows)
        if arm is not None:
            seen &= ~occluded(self._cameras.p_WC, p_W, arm)
        centers, shown = pixels, seen
        if config.merging:
            centers, shown = merged_images(pixels, seen, marker_diameters(self._cameras, self._body, p_W))
        shown = shown & (ndtr(noise[:, 2 * m : 3 * m]) >= config.missing)
        found = centers + config.pixel_sigma * noise[:, : 2 * m].reshape(n, m, 2)
        found[~shown] = np.nan
        blobs = np.concatenate([found, self._false_blobs(pixels, noise[:, 3 * m :])], axis=1)
        blobs[~in_window(blobs, self._windows)] = np.nan
        order = np.argsort(blobs[..., 1], axis=1)  # NaN goes last
        return np.take_along_axis(blobs, order[..., None], axis=1)

    def _false_blobs(self, pixels: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """False blobs (n, FALSE_SLOTS, 2), in the box about the markers or up to its own size beside it."""
        n = len(pixels)
        if self._config.false == 0.0:
            return np.full((n, FALSE_SLOTS, 2), np.nan)
        low, high = np.fmin.reduce(pixels, axis=1), np.fmax.reduce(pixels, axis=1)
        chance = ndtr(noise)
        where = 3.0 * chance[:, 1:].reshape(n, FALSE_SLOTS, 2) - 1.0
        false = low[:, None] + where * (high - low)[:, None]
        return np.where((chance[:, :1] > self._false_counts)[..., None], false, np.nan)


def _check(config: FeatureConfig) -> None:
    if not 0.0 <= config.pixel_sigma < np.inf:
        raise ValueError(f"features: pixel_sigma must not be negative, got {config.pixel_sigma} px")
    if not 0.0 <= config.missing < 1.0:
        raise ValueError(f"features: missing must be in [0, 1), got {config.missing}")
    if not 0.0 <= config.false <= MOST_FALSE:
        raise ValueError(f"features: false must be in [0, {MOST_FALSE}], got {config.false}")
