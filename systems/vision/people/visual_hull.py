"""The visual hull of what is new in a cell: the small cubes that no camera shows to be empty.

A cube is empty if one camera that could see it sees the background there. What is behind furniture, behind
the robot or outside an image is unknown to a camera, which then has no say. A cube in which enough cameras
see something new, and none the background, belongs to the hull; cubes that touch form a body.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy import ndimage

from robots.configuration.quantity import quantity
from systems.vision.camera_model import Cameras
from systems.vision.people.background import BACKGROUND, NEW, UNKNOWN, Pixels
from systems.vision.people.surroundings import Surroundings, behind

_NEIGHBOURS = np.ones((3, 3, 3))  # cubes that share a corner touch
_ABOVE_FLOOR = 0.5  # of an edge; lower cubes would be the floor itself


@dataclass
class HullConfig:
    """How finely space is looked at, and what counts as a body; read from a scenario file."""

    edge: float = quantity(0.05, 0.01, 0.5, "m")  # of a cube
    least_cameras: int = quantity(2, 1, 100)  # that see something new in a cube
    least_volume: float = quantity(0.02, 0.0, 1.0, "m^3")  # of a body; a person has 0.06 or more


@dataclass(frozen=True)
class Body:
    """Something new in the cell."""

    points: np.ndarray  # middles of its cubes in the world in m, (k, 3)
    volume: float  # m^3


class VisualHull:
    """Cubes of a cell, and where n cameras see each."""

    def __init__(
        self, cameras: Cameras, size: tuple[int, int], surroundings: Surroundings, config: HullConfig
    ) -> None:
        """Projects all cubes once.

        Args:
            cameras: of the images.
            size: width and height of an image in px.
            surroundings: the volume, and what hides parts of it.
            config: size of the cubes.
        """
        self._config, edge = config, config.edge
        low = surroundings.low.copy()
        low[2] = max(low[2], surroundings.floor + _ABOVE_FLOOR * edge)
        axes = [np.arange(a, b, edge) + 0.5 * edge for a, b in zip(low, surroundings.high, strict=True)]
        self._shape = tuple(map(len, axes))
        points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        still = np.zeros(len(points), bool)  # within furniture
        for each in surroundings.furniture:
            X = each.placement.pose()
            inside = np.abs((points - X.translation()) @ X.rotation().matrix()) <= 0.5 * each.size
            still |= inside.all(axis=1)
        self._cells = np.flatnonzero(~still)
        self._points = points[self._cells]
        self._places = [self._place(cameras.subset([i]), size, surroundings) for i in range(len(cameras))]

    def _place(self, camera: Cameras, size: tuple[int, int], surroundings: Surroundings) -> np.ndarray:
        """The pixel of each cube in a camera, counted through the rows; the one after the last if unseen."""
        width, height = size
        pixels = np.rint(np.nan_to_num(camera.project(self._points)[0], nan=-1e6))
        u, v = pixels[:, 0], pixels[:, 1]
        seen = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        for each in surroundings.furniture:
            # Only what lies within the frame of the box in the image can be hidden by it.
            corners = camera.project(each.corners)[0]
            low, high = corners.min(axis=0), corners.max(axis=0)
            maybe = np.flatnonzero(seen & ~((pixels < low) | (pixels > high)).any(axis=1))
            seen[maybe] = ~behind(each, camera.p_WC[0], self._points[maybe])
        return np.where(seen, v * width + u, width * height).astype(np.int32)

    def bodies(self, pixels: list[Pixels]) -> list[Body]:
        """What is new according to all cameras, the largest first; images without trust have no say."""
        left, count = np.arange(len(self._cells)), np.zeros(len(self._cells), np.uint8)
        trusted = [i for i, each in enumerate(pixels) if each.trusted]
        # Cameras that see least that is new or unknown empty most of the space, so that the rest is quick.
        trusted.sort(key=lambda i: int(np.count_nonzero(pixels[i].code)))
        for i in trusted:
            code = np.append(pixels[i].code.ravel(), UNKNOWN)[self._places[i][left]]
            keep = code != BACKGROUND
            left, count = left[keep], count[keep] + (code[keep] == NEW)
        left = left[count >= self._config.least_cameras]
        return self._grouped(left)

    def _grouped(self, cells: np.ndarray) -> list[Body]:
        if not len(cells):
            return []
        full = np.zeros(self._shape, bool)
        full.ravel()[self._cells[cells]] = True
        labels, number = cast(tuple[np.ndarray, int], ndimage.label(full, _NEIGHBOURS))
        label = labels.ravel()[self._cells[cells]]
        sizes = np.bincount(label, minlength=number + 1)
        least = self._config.least_volume / self._config.edge**3
        order = [k for k in np.argsort(-sizes) if k and sizes[k] >= least]
        return [Body(self._points[cells[label == k]], float(sizes[k]) * self._config.edge**3) for k in order]
