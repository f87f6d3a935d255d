"""Depth of field of a thin lens: how far points are spread out of focus, and which distances are sharp.

Probst (2024) eqs. (3.1) to (3.3), corrected: his near and far points are approximations with a wrong sign in
the far one; these follow from the circle of confusion without approximation.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class DepthOfField:
    """A lens that is focused at one distance; distances count from the plane of the lens."""

    focal_length: float  # m
    f_number: float  # focal length by diameter of the aperture
    focus_distance: float  # m, from the lens to the plane that is in focus
    pixel_pitch: float  # m, the largest circle of confusion that still is sharp

    def __post_init__(self) -> None:
        """Checks the values.

        Raises:
            ValueError: if one is not positive, or the plane in focus is not beyond the focal length.
        """
        for name in self.__dataclass_fields__:
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"depth of field: {name} must be positive, got {getattr(self, name)}")
        if not self.focus_distance > self.focal_length:
            raise ValueError(
                f"depth of field: focus_distance must be beyond the focal length of {self.focal_length} m, "
                f"got {self.focus_distance} m"
            )

    @property
    def hyperfocal(self) -> float:
        """The hyperfocal distance d_h = f^2 / (k' Z) + f in m, Probst (2024) eq. (3.2), Z the pixel pitch."""
        return self.focal_length**2 / (self.f_number * self.pixel_pitch) + self.focal_length

    @property
    def near(self) -> float:
        """The nearest sharp distance g (d_h - f) / (d_h + g - 2 f) in m, Probst (2024) eq. (3.1), exact."""
        f, g, d_h = self.focal_length, self.focus_distance, self.hyperfocal
        return g * (d_h - f) / (d_h + g - 2.0 * f)

    @property
    def far(self) -> float:
        """The farthest sharp distance g (d_h - f) / (d_h - g) in m, Probst (2024) eq. (3.3), corrected.

        It is infinite where the lens is focused at the hyperfocal distance or beyond.
        """
        f, g, d_h = self.focal_length, self.focus_distance, self.hyperfocal
        return g * (d_h - f) / (d_h - g) if g < d_h else np.inf

    def blur_circle(self, distance: np.ndarray) -> np.ndarray:
        """Diameters of the circles on the sensor in m, to which points at distances in m are spread."""
        f, g = self.focal_length, self.focus_distance
        distance = np.asarray(distance, dtype=float)
        return f * f / self.f_number * np.abs(distance - g) / (distance * (g - f))

    def blur_sigma_px(self, distance: np.ndarray) -> np.ndarray:
        """Standard deviations along an axis of these circles in px: a quarter of the diameter of a disc."""
        return 0.25 * self.blur_circle(distance) / self.pixel_pitch
