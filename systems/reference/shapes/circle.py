"""A circle, once or several times around, with the tool in one orientation."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robots.configuration.quantity import positive, quantity, vector
from systems.reference.segment import Segment, closed, rotation
from systems.reference.shapes.checked import checked


@dataclass
class Circle:
    """A circle in the xy plane of a frame at its center; it starts on that frame's x axis, towards y."""

    kind: ClassVar[str] = "circle"
    rests: ClassVar[bool] = False
    center_mm: np.ndarray = vector((450.0, 0.0, 400.0), unit="mm")  # in the world
    radius_mm: float = positive(100.0, "mm")  # of the circle
    plane_zyx_deg: np.ndarray = vector((0.0, 0.0, 0.0), unit="deg")  # of the frame of the plane
    zyx_deg: np.ndarray = vector((90.0, 0.0, 90.0), unit="deg")  # of the tool, constant
    turns: int = quantity(1, 1, 100000)  # without a rest between them

    @property
    def length(self) -> float:
        """Of the parameter, which counts turns."""
        return float(self.turns)

    def segments(self) -> list[Segment]:
        """The piece of which the path is made. Raises ValueError if a number is out of its range."""
        checked(self)
        x_axis, y_axis = rotation(self.plane_zyx_deg).T[:2]
        radius = 1e-3 * self.radius_mm
        translation = {0: 1e-3 * np.asarray(self.center_mm), 3: radius * x_axis, 2: radius * y_axis}
        return [closed(rotation(self.zyx_deg), translation)]
