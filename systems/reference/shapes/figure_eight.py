"""A figure eight, once or several times around, with the tool in one orientation."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robots.configuration.quantity import positive, quantity, vector
from systems.reference.segment import Segment, closed, rotation
from systems.reference.shapes.checked import checked


@dataclass
class FigureEight:
    """A figure eight (lemniscate of Gerono) along the x axis of the frame of its plane.

    It starts at the crossing, towards +x and +y, and its curvature is continuous.
    """

    kind: ClassVar[str] = "figure_eight"
    rests: ClassVar[bool] = False
    center_mm: np.ndarray = vector((450.0, 0.0, 400.0), unit="mm")  # the crossing, in the world
    length_mm: float = positive(200.0, "mm")  # from end to end, along x of the plane
    width_mm: float = positive(100.0, "mm")  # of one loop, along y of the plane
    plane_zyx_deg: np.ndarray = vector((90.0, 0.0, 0.0), unit="deg")  # of the frame of the plane
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
        half_length, half_width = 0.5e-3 * self.length_mm, 0.5e-3 * self.width_mm
        translation = {0: 1e-3 * np.asarray(self.center_mm), 2: half_length * x_axis, 4: half_width * y_axis}
        return [closed(rotation(self.zyx_deg), translation)]
