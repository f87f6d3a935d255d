"""Fixed markers in a cell: by how much a camera has turned since they were measured."""

import numpy as np

from systems.vision.camera_model import Cameras

# Six markers about the base of a robot, in its base frame in m; assumed.
SHIPPED = np.array(
    [[0.25, 0.25, 0], [-0.25, 0.25, 0], [0.25, -0.25, 0], [-0.25, -0.25, 0.02], [0.3, 0, 0.15], [0, 0.3, 0.1]]
)


class ReferenceMarkers:
    """Markers that stand still, seen by n cameras."""

    def __init__(self, cameras: Cameras, p_W: np.ndarray, pixel_sigma: float) -> None:
        """Prepares the estimate.

        Args:
            cameras: as they were calibrated.
            p_W: the markers in the world in m, (m, 3), at least three.
            pixel_sigma: standard deviation of an image coordinate in px.

        Raises:
            ValueError: if there are too few markers or the deviation is not positive.
        """
        if len(p_W) < 3:
            raise ValueError(f"reference markers: at least 3 are needed, got {len(p_W)}")
        if not pixel_sigma > 0.0:
            raise ValueError(f"reference markers: pixel_sigma must be positive, got {pixel_sigma} px")
        self.pixels, J = cameras.project_with_jacobian(p_W)
        ray = p_W - cameras.p_WC[:, None]  # (n, m, 3)
        # A camera that turns by a small vector d sees points move by -d x ray = ray x d.
        cross = np.cross(ray[..., None, :], np.eye(3)).swapaxes(-1, -2)  # [ray]x
        self.by_rotation = (J @ cross).reshape(len(cameras), -1, 3)  # px/rad, (n, 2 m, 3)
        self._sigma = pixel_sigma
        information = self.by_rotation.swapaxes(1, 2) @ self.by_rotation / pixel_sigma**2
        self.covariance = np.linalg.inv(information)  # rad^2, of the estimate from one image, (n, 3, 3)
        self._whitening = np.linalg.cholesky(information).swapaxes(1, 2)

    def rotations(self, pixels: np.ndarray) -> np.ndarray:
        """By how much cameras have turned in rad, from pixels (..., n, m, 2), in world axes, (..., n, 3)."""
        residual = (pixels - self.pixels).reshape(*pixels.shape[:-2], -1)
        weighted = np.einsum("nij,...ni->...nj", self.by_rotation, residual) / self._sigma**2
        return np.einsum("nij,...nj->...ni", self.covariance, weighted)

    def whitened(self, rotations: np.ndarray) -> np.ndarray:
        """Rotations (..., n, 3) of cameras that stand still as independent standard normal numbers."""
        return np.einsum("nij,...nj->...ni", self._whitening, rotations)
