"""The error parameters that measurements are to determine: those of the source, or the complete model."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robots.calibration.error_model import ErrorModel
from robots.calibration.identifiability import completeness, identifiable_parameters
from robots.calibration.reduction import ReducibleModel
from robots.description.error_parameters import NUM_PARAMETERS
from robots.description.model import RobotModel
from robots.kinematics.error_kinematics import ErrorKinematics


@dataclass(frozen=True)
class ErrorParameters:
    """Independent parameters of a robot, and how they move its tool."""

    names: tuple[str, ...]
    regressor: Callable[[np.ndarray], np.ndarray]  # (n, 6) rad -> (n, 6, rank) in m and rad, rotation first

    @property
    def rank(self) -> int:
        """How many there are."""
        return len(self.names)


def error_parameters(robot: RobotModel, position_only: bool, is_complete: bool) -> ErrorParameters:
    """The parameters of a robot that poses, or positions, can tell apart.

    Args:
        robot: nominal.
        position_only: whether only the position of the tool is measured.
        is_complete: all small displacements of its placements, or the 48 parameters of Probst (2024).

    Raises:
        ValueError: as `identifiable_parameters`.
    """
    if is_complete:
        complete = ErrorModel(robot)
        zero = np.zeros(len(complete))
        chosen = ReducibleModel(complete, position_only).independent(zero)
        names = tuple(complete.names[i] for i in chosen)
        return ErrorParameters(names, lambda q: complete.forward_and_regressor(q, zero)[1][..., chosen])
    found, model = identifiable_parameters(robot, position_only), ErrorKinematics(robot)
    none = np.zeros(NUM_PARAMETERS)
    names = tuple(found.names[i] for i in found.independent)
    return ErrorParameters(names, lambda q: model.regressor(q, none)[..., found.independent])


def needs_complete(robot: RobotModel, position_only: bool) -> bool:
    """Whether the 48 parameters of Probst (2024) would miss some change of this robot's geometry."""
    return bool(completeness(robot, position_only).missed)
