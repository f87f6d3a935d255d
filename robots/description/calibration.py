"""The results of a calibration in a robot file, with their uncertainties."""

from dataclasses import dataclass, field

import numpy as np

from robots.configuration.quantity import numbers
from robots.description.joint_errors import check_names

_JOINTS = 6


@dataclass
class Calibration:
    """What has been measured on one robot, in a file that a calibration wrote; empty for a nominal robot.

    The placements of the file have the errors in them already. ``values`` says by which parameters of
    `robots.calibration.error_model` they differ from the robot that was calibrated, and how well these are
    known, for whoever goes on measuring. A robot that was learnt at work has the parameters of
    `robots.description.error_parameters`, and factors of the compliance of gears and bearings.
    """

    of: str = ""  # the robot that was calibrated: what stood in its scenario
    compliance: list[float] = numbers([0.0] * _JOINTS, (_JOINTS,), unit="rad / (N m)")  # of gravity
    source: str = ""  # the measurement; empty for a nominal robot
    names: list[str] = field(default_factory=list)  # of all parameters that were estimated
    values: list[float] = field(default_factory=list)  # m, rad, rad / (N m)
    covariance: list[list[float]] = field(default_factory=list)  # lower triangle, row by row
    # World of the robot in the frame of the instrument, where the base is displaced: m and degrees
    frame_translation: list[float] = numbers([0.0] * 3, (3,), unit="m")
    frame_zyx_deg: list[float] = numbers([0.0] * 3, (3,), unit="deg")  # of that world: alpha, beta, gamma
    joint_errors: dict[str, float] = field(default_factory=dict)  # as `robots.description.joint_errors`

    @property
    def covariance_matrix(self) -> np.ndarray:
        """Of the values, with what the prior says where the data say nothing, (m, m)."""
        matrix = np.zeros((len(self.covariance), len(self.covariance)))
        for i, row in enumerate(self.covariance):
            matrix[i, : len(row)] = matrix[: len(row), i] = row
        return matrix

    def problem(self) -> str:
        """Why this is no calibration, or an empty string."""
        try:
            check_names(tuple(self.joint_errors))
        except ValueError as error:
            return f"calibration: {error}"
        sizes = [len(self.names), len(self.values), len(self.covariance)]
        if len(set(sizes)) > 1:
            return f"calibration: names, values and covariance must be equally long, got {sizes}"
        lengths = [len(row) for row in self.covariance]
        if lengths != list(range(1, len(lengths) + 1)):
            return f"calibration: covariance must be a lower triangle, got rows of {lengths} numbers"
        return ""
