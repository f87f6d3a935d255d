"""The image of a sphere: an ellipse whose centre is not the image of the sphere's centre.

The rays that touch a sphere form a cone, and the image plane cuts it in an ellipse. For a sphere of radius r
at (X, Y, Z) in the camera frame it is, in normalised coordinates, centred at (X, Y) Z / (Z^2 - r^2): further
out than the image (X, Y) / Z of the centre, by the share r^2 / Z^2 of its distance from the optical axis. A
marker of 16 mm at 2 m and 1500 px from the axis appears 0.024 px too far out; in the shipped cell it is up to
0.006 px. The lens bends the ellipse by much less than that and is taken as linear over it.
"""

from dataclasses import dataclass

import numpy as np

from systems.vision.camera_model import Cameras


@dataclass(frozen=True)
class Ellipses:
    """The outlines of m spheres in n cameras; NaN for a sphere that is not in front of a camera."""

    center: np.ndarray  # px, (n, m, 2)
    shape: np.ndarray  # px^2, S with (p - center)^T S^-1 (p - center) = 1 on the outline, (n, m, 2, 2)


def sphere_images(cameras: Cameras, p_W: np.ndarray, radius: float) -> Ellipses:
    """The outlines of spheres with their centres at p_W (m, 3) and one radius, both in m."""
    p_C = cameras.in_camera_frames(p_W)
    z = np.where(p_C[..., 2:] > radius, p_C[..., 2:], np.nan)
    across, squeeze = p_C[..., :2], z * z - radius * radius
    center, J = cameras.through_lens(across * z / squeeze)
    stretch = np.eye(2) + across[..., :, None] * across[..., None, :] / squeeze[..., None]
    shape = (radius * radius / squeeze)[..., None] * stretch
    return Ellipses(center, J @ shape @ J.swapaxes(-1, -2))


def sphere_centers(cameras: Cameras, centroids: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """Where the centres of spheres are seen, from the centroids and areas of their images.

    The area tells how far away a sphere is in units of its radius, and so how far out it appears: no size and
    no distance need be known. The area of an ellipse that is A in normalised coordinates is
    pi r^2/Z^2 sqrt(1 + x^2 + y^2) to first order in r^2/Z^2.

    Args:
        cameras: n cameras.
        centroids: px, shape (n, b, 2), NaN where there is none.
        areas: px^2, shape (n, b).

    Returns:
        px, shape (n, b, 2).
    """
    # The share is a few millionths, so that it does not matter on which side of the lens it is taken.
    xy = (centroids - cameras.center[:, None]) / cameras.focal[:, None]
    slant = np.sqrt(1.0 + np.sum(xy * xy, -1))
    share = areas / (np.pi * np.prod(cameras.focal, axis=1)[:, None] * slant)
    return centroids - share[..., None] * xy * cameras.focal[:, None]
