"""Size of the marker images, and which of them merge into one blob."""

import numpy as np

from systems.vision import kernels
from systems.vision.camera_model import Cameras
from systems.vision.marker_body import DetectionBody


def marker_diameters(cameras: Cameras, body: DetectionBody, p_W: np.ndarray) -> np.ndarray:
    """How large markers at p_W (m, 3) appear in px, (n, m); about: focal length times size over depth."""
    return cameras.focal[:, :1] * body.diameter / cameras.depth(p_W)


def touching(pixels: np.ndarray, diameters: np.ndarray) -> np.ndarray:
    """Which images of markers touch each other: (n, m, 2) and (n, m) to (n, m, m), False on the diagonal."""
    return kernels.frames.touching(pixels, diameters)


def image_shares(close: np.ndarray, seen: np.ndarray, diameters: np.ndarray) -> np.ndarray:
    """What each blob shows of each marker: markers whose images touch share one, the first of them has it.

    Args:
        close: which images touch, as `touching` says, shape (n, m, m).
        seen: which markers are seen at all, shape (n, m).
        diameters: of the images in px, shape (n, m).

    Returns:
        Shape (n, m, m), one row for each marker: the shares of all markers in the middle of its blob, by the
        areas of their images, with sum one; zero if it has no blob of its own.
    """
    own = np.eye(close.shape[-1])
    close = close & seen[:, :, None] & seen[:, None]
    if not close.any():
        return own * seen[:, None]
    group = close | own.astype(bool)
    while True:  # friends of friends
        wider = group @ group
        if (wider == group).all():
            break
        group = wider
    first = seen & (group.argmax(-1) == np.arange(close.shape[-1]))
    area = np.where(group & first[:, :, None], (diameters**2)[:, None], 0.0)
    return area / np.where(first, area.sum(-1), 1.0)[:, :, None]


def shared_images(close: np.ndarray, seen: np.ndarray, diameters: np.ndarray) -> np.ndarray:
    """The rows of `image_shares` that more than one marker is in, (n, s, m).

    Cameras with fewer of them than the s of the one with most have rows of zeros behind them.
    """
    if not close.any():
        return np.zeros((len(close), 0, close.shape[-1]))
    share = image_shares(close, seen, diameters)
    shared = np.count_nonzero(share, axis=2) > 1
    order = np.argsort(~shared, axis=1, kind="stable")[:, : shared.sum(1).max()]
    return np.take_along_axis(share * shared[..., None], order[..., None], axis=1)


def merged_images(
    pixels: np.ndarray, seen: np.ndarray, diameters: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The blobs of markers some of whose images touch.

    Args:
        pixels: of the centres, shape (n, m, 2).
        seen: which of them are seen at all, shape (n, m).
        diameters: of the images in px, shape (n, m).

    Returns:
        The middles of the blobs, (n, m, 2), and which of them exist, (n, m).
    """
    share = image_shares(touching(pixels, diameters), seen, diameters)
    return share @ np.where(seen[..., None], pixels, 0.0), np.any(share, axis=-1)
