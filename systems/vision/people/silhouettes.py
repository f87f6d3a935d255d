"""Which pixels of whole images show the robot, from its joints: outlines of capsules, filled."""

import cv2
import numpy as np

from robots.kinematics.arm_capsules import Capsules
from systems.vision.camera_model import Cameras
from systems.vision.sphere_images import sphere_images

_CORNERS = 16  # of the polygon that stands for the outline of a ball
_FAR = 1e5  # px, what is close to a lens may reach that far out of its image
_FINE = 4  # bits behind the point of a pixel


def silhouettes(
    cameras: Cameras, capsules: Capsules, size: tuple[int, int], margin: float = 0.0
) -> np.ndarray:
    """The pixels behind capsules that are thicker by a margin.

    The outline of a capsule is taken as the convex hull of those of the balls at its ends; the lens bends it
    by less than the margin.

    Args:
        cameras: n cameras, whose images they are.
        capsules: k of them in the world.
        size: width and height of the images in px.
        margin: m, added to each radius.

    Returns:
        (n, height, width) of uint8: 1 where a capsule is seen, else 0.
    """
    ends = np.stack([capsules.start, capsules.end], 1)
    outlines = np.stack(
        [
            _outlines(cameras, points, radius + margin)
            for points, radius in zip(ends, capsules.radius, strict=True)
        ],
        1,
    )
    masks = np.zeros((len(cameras), size[1], size[0]), np.uint8)
    for mask, shapes in zip(masks, outlines, strict=True):
        for points in shapes:
            if np.isfinite(points).all():
                hull = cv2.convexHull(np.clip(points, -_FAR, _FAR).astype(np.float32))
                corners = np.rint(hull * (1 << _FINE)).astype(np.int32)
                cv2.fillConvexPoly(mask, corners, (1.0,), cv2.LINE_8, _FINE)
    return masks


def _outlines(cameras: Cameras, ends: np.ndarray, radius: float) -> np.ndarray:
    """Corners (n, 2 * 16, 2) in px about the images of two balls."""
    ellipses = sphere_images(cameras, ends, radius)
    angle = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    # The corners lie on the outline, so that the polygon has to be larger by this factor to hold it.
    circle = np.stack([np.cos(angle), np.sin(angle)]) / np.cos(np.pi / _CORNERS)
    values, vectors = np.linalg.eigh(np.nan_to_num(ellipses.shape))
    half = vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
    return (ellipses.center[..., None, :] + (half @ circle).swapaxes(-1, -2)).reshape(len(cameras), -1, 2)
