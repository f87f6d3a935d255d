"""The results of a calibration in a robot file, with their uncertainties."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robots.configuration.nodes import YAML, Node
from robots.configuration.quantity import numbers
from robots.description.joint_errors import check_names

_JOINTS = 6
FILES = (*YAML, ".urdf", ".xacro")  # how names of robot files end


@dataclass
class Calibration:
    """What has been measured on one robot, in a file that a calibration wrote; empty for a nominal robot.

    The placements of the file have the errors in them already. ``values`` says by which parameters of
    `robots.calibration.error_model` they differ from the robot that was calibrated, and how well these are
    known, for whoever goes on measuring. A robot that was learnt at work has the parameters of
    `robots.description.error_parameters`, and factors of the compliance of gears and bearings.
    """

    of: str = ""  # the robot that was calibrated: a shipped one, or a file as it is found from this one
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


def with_nominal_from(folder: Path, robot: Node) -> Node:
    """The nodes of a robot file in which ``calibration.of``, where it is a file, is a whole path.

    Args:
        folder: of the robot file, from where the path begins. In older files it begins where their
            calibration ran: one that is found only there is taken, too.
        robot: nodes of the file.
    """
    calibration = robot.value.get("calibration") if isinstance(robot.value, dict) else None
    if calibration is None or not isinstance(calibration.value, dict):
        return robot
    of = calibration.value.get("of")
    if of is None or not names_file(of.value):
        return robot
    found = next((path for path in (folder / of.value, Path(of.value)) if path.is_file()), None)
    if found is None:
        return robot
    entries = calibration.value | {"of": Node(str(found.resolve()), of.place)}
    inside = Node(entries, calibration.place, calibration.tag, calibration.aside)
    return Node(robot.value | {"calibration": inside}, robot.place, robot.tag, robot.aside)


def names_file(robot: object) -> bool:
    """Whether a robot is named by the path of its file, not by the name of a shipped one."""
    return isinstance(robot, str) and robot.lower().endswith(FILES)


def is_same_robot(one: str, other: str) -> bool:
    """Whether two names are of one robot: paths may be written in different ways."""
    if names_file(one) and names_file(other):
        return Path(one).resolve() == Path(other).resolve()
    return one == other
