"""Deviations of the true robot from its nominal geometry: 48 errors in the units of a scenario file.

The nominal model never changes; a true plant takes these errors into the placement of its frames.
"""

from dataclasses import dataclass, field

import numpy as np

from robots.configuration.quantity import named, quantity, vector
from robots.description.error_parameters import (
    FRAMES,
    OFFSET,
    SHIFT,
    TOOL,
    ErrorParameter,
    checked,
    error_parameters,
)
from robots.description.model import NUM_JOINTS, RobotModel

# More is no error of a geometry but another robot, or a number in another unit.
_FAR = 200.0  # mm
_TURNED = 45.0  # degrees


@dataclass
class RandomErrors:
    """Errors drawn uniformly within bounds, the same ones for the same seed; zero bounds draw none."""

    seed: int = quantity(0, 0, 2**32 - 1)  # of the random draw
    # Largest translation, of a frame or the tool, along each axis
    translation_mm: float = quantity(0.0, 0.0, _FAR, "mm")
    # Largest rotation, of a joint, body or the tool, about each axis
    rotation_deg: float = quantity(0.0, 0.0, _TURNED, "deg")

    def vector(self, robot: RobotModel) -> np.ndarray:
        """One draw in m and rad, in the order of `error_parameters`, shape (48,).

        Raises:
            ValueError: if a bound is negative or not finite.
        """
        for label in ("translation_mm", "rotation_deg"):
            if not 0.0 <= getattr(self, label) < np.inf:
                raise ValueError(
                    f"errors.random.{label} must be finite and not negative, got {getattr(self, label)}"
                )
        bounds = {"m": 1e-3 * self.translation_mm, "rad": np.deg2rad(self.rotation_deg)}
        largest = np.array([bounds[parameter.unit] for parameter in error_parameters(robot)])
        return largest * np.random.default_rng(self.seed).uniform(-1.0, 1.0, len(largest))


@dataclass
class GeometricErrors:
    """Deviations of the true geometry, Probst (2024), section 2.3 and table 6.1.

    A true joint stands at the measured position plus its offset, eq. (2.47). The tool's translation and
    its ZYX Euler angles (alpha, beta, gamma) are added to the nominal ones, eq. (2.48). The other frames are
    displaced along the axes of their parents (``pl_I0`` to ``pl_56``), and the bodies (``body_0`` to
    ``body_6``) are turned by small angles about x, y and z, as `error_parameters` says. A turn about the
    joint's own axis must be zero, because that is the joint's offset. Random errors come on top.
    """

    # True angle minus measured one, six
    joint_offset_deg: np.ndarray = vector([0.0] * NUM_JOINTS, -_TURNED, _TURNED, "deg")
    # Added to the tool's, along the axes of the flange
    tool_translation_mm: np.ndarray = vector([0.0] * 3, -_FAR, _FAR, "mm")
    # Alpha, beta, gamma, added to the tool's
    tool_zyx_deg: np.ndarray = vector([0.0] * 3, -_TURNED, _TURNED, "deg")
    # Displacements along the axes of the parent, by frame: pl_I0 the base, pl_01 to pl_56 the joints
    frame_translation_mm: dict[str, np.ndarray] = named(
        3, -_FAR, _FAR, "mm", default=lambda: {f"pl_{frame}": np.zeros(3) for frame in FRAMES[:TOOL]}
    )
    # Small turns about x, y and z, by body: body_0 the base, body_1 to body_6 the links
    body_rotation_deg: dict[str, np.ndarray] = named(
        3, -_TURNED, _TURNED, "deg", default=lambda: {f"body_{body}": np.zeros(3) for body in range(TOOL)}
    )
    random: RandomErrors = field(default_factory=RandomErrors)

    def vector(self, robot: RobotModel) -> np.ndarray:
        """The error parameters in m and rad, in the order of `error_parameters`, shape (48,).

        Raises:
            ValueError: if a name is unknown, a number is not finite, or a body is turned about the axis of
                its joint.
        """
        defaults = GeometricErrors()
        for label in ("frame_translation_mm", "body_rotation_deg"):
            known = getattr(defaults, label)
            for name in getattr(self, label):
                if name not in known:
                    raise ValueError(f"{label} must be one of {', '.join(known)}, got '{name}'")
        parameters = error_parameters(robot)
        for parameter in parameters[:NUM_JOINTS]:
            angle = self._triple(parameter, "body_rotation_deg")[parameter.axis]
            if angle != 0.0:
                raise ValueError(
                    f"body_rotation_deg.body_{parameter.body}: the turn about {'xyz'[parameter.axis]}, the "
                    f"axis of joint {parameter.body}, must be 0, got {angle} deg; give it as joint_offset_deg"
                )
        named = checked(np.array([self._value(parameter) for parameter in parameters]))
        return named + self.random.vector(robot)

    @staticmethod
    def from_vector(robot: RobotModel, p: np.ndarray) -> "GeometricErrors":
        """The errors whose `vector` is p, shape (48,), in m and rad.

        Raises:
            ValueError: if p has another shape or is not finite.
        """
        errors = GeometricErrors()
        for parameter, value in zip(error_parameters(robot), checked(p), strict=True):
            entries, index, unit = errors._slot(parameter)
            entries[index] = value / unit
        return errors

    def _value(self, parameter: ErrorParameter) -> float:
        entries, index, unit = self._slot(parameter)
        return float(entries[index]) * unit

    def _slot(self, parameter: ErrorParameter) -> tuple[np.ndarray, int, float]:
        """Where a parameter stands here, and its unit in m or rad."""
        degree = np.pi / 180.0
        if parameter.kind == OFFSET:
            return self.joint_offset_deg, parameter.body - 1, degree
        if parameter.kind == SHIFT:
            return self._triple(parameter, "frame_translation_mm"), parameter.axis, 1e-3
        if parameter.body == TOOL:
            return self.tool_zyx_deg, 2 - parameter.axis, degree  # alpha, about z, comes first
        return self._triple(parameter, "body_rotation_deg"), parameter.axis, degree

    def _triple(self, parameter: ErrorParameter, label: str) -> np.ndarray:
        """The three numbers of a frame or a body; what a file leaves out is zero."""
        if label == "frame_translation_mm":
            if parameter.body == TOOL:
                return self.tool_translation_mm
            return self.frame_translation_mm.get(f"pl_{FRAMES[parameter.body]}", np.zeros(3))
        return self.body_rotation_deg.get(f"body_{parameter.body}", np.zeros(3))
