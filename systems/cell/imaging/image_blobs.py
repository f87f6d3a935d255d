"""Blobs by way of pictures: windows about the body, exposed, thresholded and weighed."""

import numpy as np

from robots.kinematics.arm_capsules import Capsules
from systems.cell.imaging.images import ImageConfig, ImageSource
from systems.vision.blobs.centroids import CentroidConfig, blobs_in, check_centroids
from systems.vision.camera_model import Cameras
from systems.vision.marker_body import DetectionBody


class ImageBlobs:
    """The blobs that n cameras find in their pictures of a body; to a tracker like those of features."""

    noise_size = ImageSource.noise_size  # standard normal numbers for one exposure

    def __init__(
        self,
        cameras: Cameras,
        windows: np.ndarray,
        body: DetectionBody,
        images: ImageConfig,
        centroids: CentroidConfig,
    ) -> None:
        """Arguments as those of `systems.cell.imaging.images.ImageSource`.

        Raises:
            ValueError: if a number is out of its range.
        """
        check_centroids(centroids)
        self._cameras, self._centroids = cameras, centroids
        self._source = ImageSource(cameras, windows, body, images, centroids.threshold)

    def blobs(
        self,
        X_WE: np.ndarray,
        V_WE: np.ndarray,
        expected: np.ndarray | None,
        noise: np.ndarray,
        arm: Capsules | None = None,
    ) -> np.ndarray:
        """One exposure: pixels, shape (n, b, 2), NaN where there is none.

        Args:
            X_WE: the tool in the world amid the exposure, homogeneous matrix (4, 4).
            V_WE: its velocity, rotation first, in rad/s and m/s, shape (6,).
            expected: where the body is looked for, (4, 4); None for everywhere.
            noise: standard normal numbers, shape (noise_size,).
            arm: what may stand in the way; None for nothing.
        """
        pictures = self._source.expose(X_WE, V_WE, noise, self._source.windows(expected), arm)
        return blobs_in(pictures, self._cameras, self._centroids)
