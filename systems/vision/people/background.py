"""The empty cell as each camera remembers it, and which pixels of a new image differ from it.

Light changes as a whole: the brightness of an image relative to the memory is estimated first, as the median
over pixels that are not expected to show anything new. The memory follows slow changes where an image shows
nothing new, so that a person who stands still is never absorbed. What the robot hides is unknown, and what no
camera has yet seen without the robot is unknown, too.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from robots.configuration.quantity import quantity

BACKGROUND, NEW, UNKNOWN = 0, 1, 2  # what a pixel shows
_GRID = 8  # px, between those that the brightness is estimated from
_DARK = 25  # of 255, below which a pixel says nothing about brightness
_OPENING = np.ones((3, 3), np.uint8)


@dataclass
class BackgroundConfig:
    """When a pixel is new and when an image is trusted; read from a scenario file."""

    threshold: int = quantity(18, 1, 200)  # of 255, difference in any colour: six sigma of a noise of 3
    widening: int = quantity(5, 1, 31, "px")  # of what is new, against gaps in it
    adaptation: float = quantity(0.05, 0.0, 1.0)  # share of a new image in the memory, when it is its turn
    largest_gain: float = quantity(1.6, 1.0, 10.0)  # of the light, up or down; trusted within
    largest_share: float = quantity(0.4, 0.0, 1.0, is_open=True)  # of new pixels, likewise


@dataclass(frozen=True)
class Memory:
    """What n cameras remember; images of h x w pixels."""

    mean: tuple[np.ndarray, ...]  # n of (h, w, 3) of float32, 0 to 255
    seen: np.ndarray  # (n, h, w) of bool: was there ever an image without the robot?
    turn: int = 0  # the camera whose memory adapts next

    def __deepcopy__(self, memo: dict[int, Any]) -> "Memory":
        """Itself, for nothing in it changes: Drake copies states, and images are large."""
        return self


@dataclass(frozen=True)
class Pixels:
    """What the pixels of one camera show."""

    code: np.ndarray  # (h, w) of uint8: BACKGROUND, NEW or UNKNOWN
    gain: float  # brightness relative to the memory
    trusted: bool


def remembered(images: list[np.ndarray], masks: list[np.ndarray]) -> Memory:
    """A memory from images of the empty cell with the robot at several places.

    Args:
        images: sets of n images, (n, h, w, 3) of uint8 each.
        masks: where the robot was in each, (n, h, w), nonzero there.

    Raises:
        ValueError: if there is no set.
    """
    if not images:
        raise ValueError("background: at least one set of images of the empty cell is needed, got none")
    free = [(mask == 0)[..., None] for mask in masks]
    total = sum(np.where(f, image, 0).astype(np.float32) for f, image in zip(free, images, strict=True))
    count = np.sum(free, axis=0)
    # Where the robot always was, its picture is kept and never used.
    mean = np.where(count > 0, total / np.maximum(count, 1), images[0].astype(np.float32))
    return Memory(tuple(mean.astype(np.float32)), count[..., 0] > 0)


def compare(
    memory: Memory, camera: int, image: np.ndarray, mask: np.ndarray, config: BackgroundConfig
) -> Pixels:
    """What the image (h, w, 3) of a camera shows, where ``mask`` (h, w) is nonzero for the robot."""
    mean, unknown = memory.mean[camera], (mask > 0) | ~memory.seen[camera]
    gain = _gain(mean, image, unknown)
    expected = cv2.convertScaleAbs(mean, alpha=gain)
    blue, green, red = cv2.split(cv2.absdiff(image, expected))
    difference = cv2.max(cv2.max(blue, green), red)
    _, new = cv2.threshold(difference, config.threshold, NEW, cv2.THRESH_BINARY)
    new[unknown] = 0
    new = cv2.morphologyEx(new, cv2.MORPH_OPEN, _OPENING)
    share = float(cv2.countNonZero(new)) / max(1, new.size - int(np.count_nonzero(unknown)))
    if config.widening > 1:
        new = cv2.dilate(new, np.ones((config.widening, config.widening), np.uint8))
    new[unknown] = UNKNOWN
    trusted = 1.0 / config.largest_gain <= gain <= config.largest_gain and share <= config.largest_share
    return Pixels(new, gain, trusted)


def adapted(memory: Memory, images: np.ndarray, pixels: list[Pixels], config: BackgroundConfig) -> Memory:
    """The memory after a set of images, of which that of one camera is taken in; they take turns."""
    i = memory.turn
    turn = (i + 1) % len(images)
    if not pixels[i].trusted or not config.adaptation:
        return Memory(memory.mean, memory.seen, turn)
    mean = memory.mean[i].copy()
    known = cv2.erode((pixels[i].code == BACKGROUND).astype(np.uint8), _OPENING)
    cv2.accumulateWeighted(images[i], mean, config.adaptation, known)
    return Memory((*memory.mean[:i], mean, *memory.mean[i + 1 :]), memory.seen, turn)


def _gain(mean: np.ndarray, image: np.ndarray, unknown: np.ndarray) -> float:
    """The median of brightness by remembered brightness, over a grid of pixels that are known."""
    before = mean[::_GRID, ::_GRID].sum(axis=2)
    now = image[::_GRID, ::_GRID].sum(axis=2, dtype=np.float32)
    usable = ~unknown[::_GRID, ::_GRID] & (before > 3 * _DARK)
    if not usable.any():
        return 1.0
    return float(np.median(now[usable] / before[usable]))
