"""How markers appear in the images: how large, and which of them as one."""

import numpy as np

from systems.tracking.camera_model import Cameras
from systems.tracking.detection_body import DetectionBody


def marker_diameters(cameras: Cameras, body: DetectionBody, p_W: np.ndarray) -> np.ndarray:
    """How large markers at p_W (m, 3) appear in px, (n, m); about: focal length times size over depth."""
    return cameras.focal[:, :1] * body.diameter / cameras.depth(p_W)


def touching(pixels: np.ndarray, diameters: np.ndarray) -> np.ndarray:
    """Which images of markers touch each other: (n, m, 2) and (n, m) to (n, m, m), False on the diagonal."""
    u, v = pixels[..., 0], pixels[..., 1]
    du, dv = u[:, :, None] - u[:, None], v[:, :, None] - v[:, None]
    reach = 0.5 * (diameters[:, :, None] + diameters[:, None])
    close = du * du + dv * dv < reach * reach
    diagonal = np.arange(pixels.shape[1])
    close[:, diagonal, diagonal] = False
    return close


def merged_images(
    pixels: np.ndarray, seen: np.ndarray, diameters: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What is seen of markers whose images touch: the first of a group shines for all of it.

    Args:
        pixels: of the centres, shape (n, m, 2).
        seen: which of them are seen at all, shape (n, m).
        diameters: of the images in px, shape (n, m).

    Returns:
        The centres of the blobs, the mean of each group weighted by the areas of its images, (n, m, 2), and
        which of them exist, (n, m).
    """
    close = touching(pixels, diameters) & seen[:, :, None] & seen[:, None]
    if not np.any(close):
        return pixels, seen
    group = close | np.eye(pixels.shape[1], dtype=bool)
    while True:  # friends of friends
        wider = group @ group
        if (wider == group).all():
            break
        group = wider
    weight = np.where(group & seen[:, None], (diameters**2)[:, None], 0.0)
    total = weight.sum(-1, keepdims=True)
    mean = weight @ np.where(seen[..., None], pixels, 0.0) / np.where(total > 0.0, total, 1.0)
    first = group.argmax(-1) == np.arange(pixels.shape[1])
    return np.where(np.any(close, -1)[..., None], mean, pixels), seen & first
