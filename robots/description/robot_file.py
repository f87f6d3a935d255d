"""Writes a robot as a file that `robots.description.model.load_robot` reads back, number for number."""

import copy
from dataclasses import replace
from pathlib import Path

from pydrake.common.yaml import yaml_dump_typed

from robots.description.model import RobotModel


def robot_text(robot: RobotModel, beside: Path | None = None) -> str:
    """The robot as YAML with all digits of its numbers; the rows of a covariance each in a line.

    Args:
        robot: what is written.
        beside: where the file will be. Meshes in its folder and below are named from there, so that the
            folder can be moved; all others, and without it all of them, have whole paths.
    """
    covariance = robot.calibration.covariance
    robot = replace(robot, calibration=replace(robot.calibration, covariance=[]))
    text = str(yaml_dump_typed(_named_from(beside.resolve().parent, robot) if beside else robot))
    if not covariance:
        return text
    rows = "".join(f"\n  - [{', '.join(map(repr, row))}]" for row in covariance)
    return text.replace("\n  covariance: []", f"\n  covariance:{rows}", 1)


def _named_from(folder: Path, robot: RobotModel) -> RobotModel:
    """The robot with the paths of its meshes as they are from a folder."""
    robot = copy.deepcopy(robot)
    for picture in (each for link in (robot.base_link, *robot.links) for each in link.pictures):
        file = Path(picture.file)
        if picture.file and file.is_relative_to(folder):
            picture.file = file.relative_to(folder).as_posix()
    return robot
