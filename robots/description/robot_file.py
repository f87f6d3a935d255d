"""Writes a robot as a file that `robots.description.model.load_robot` reads back, number for number."""

from dataclasses import replace

from pydrake.common.yaml import yaml_dump_typed

from robots.description.model import RobotModel


def robot_text(robot: RobotModel) -> str:
    """The robot as YAML with all digits of its numbers; the rows of a covariance each in a line."""
    covariance = robot.calibration.covariance
    text = str(yaml_dump_typed(replace(robot, calibration=replace(robot.calibration, covariance=[]))))
    if not covariance:
        return text
    rows = "".join(f"\n  - [{', '.join(map(repr, row))}]" for row in covariance)
    return text.replace("\n  covariance: []", f"\n  covariance:{rows}", 1)
