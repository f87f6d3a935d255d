"""Writes a robot as a file that `robots.description.model.load_robot` reads back, number for number."""

import copy
import os
from dataclasses import replace
from pathlib import Path

from pydrake.common.yaml import yaml_dump_typed

from robots.description.calibration import names_file
from robots.description.model import RobotModel


def robot_text(robot: RobotModel, beside: Path | None = None) -> str:
    """The robot as YAML with all digits of its numbers; the rows of a covariance each in a line.

    Args:
        robot: what is written.
        beside: where the file will be. Meshes in its folder and below, and the file of the robot that was
            calibrated, are named from there, so that the folder can be moved; all others, and without it
            all of them, have whole paths.
    """
    covariance, folder = robot.calibration.covariance, beside.resolve().parent if beside else None
    of = _nominal_from(folder, robot.calibration.of)
    robot = replace(robot, calibration=replace(robot.calibration, covariance=[], of=of))
    text = str(yaml_dump_typed(_named_from(folder, robot) if folder else robot))
    if not covariance:
        return text
    rows = "".join(f"\n  - [{', '.join(map(repr, row))}]" for row in covariance)
    return text.replace("\n  covariance: []", f"\n  covariance:{rows}", 1)


def _nominal_from(folder: Path | None, of: str) -> str:
    """The robot that was calibrated as it is found from a folder; a shipped one by its name."""
    file = Path(of)
    if not names_file(of) or not file.is_file():
        return of
    if folder is None or file.resolve().anchor != folder.anchor:  # another drive
        return str(file.resolve())
    return Path(os.path.relpath(file.resolve(), folder)).as_posix()


def _named_from(folder: Path, robot: RobotModel) -> RobotModel:
    """The robot with the paths of its meshes as they are from a folder."""
    robot = copy.deepcopy(robot)
    for picture in (each for link in (robot.base_link, *robot.links) for each in link.pictures):
        file = Path(picture.file)
        if picture.file and file.is_relative_to(folder):
            picture.file = file.relative_to(folder).as_posix()
    return robot
