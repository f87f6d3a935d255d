"""Writes a robot as a file that `robots.description.model.load_robot` reads back, number for number."""

from pydrake.common.yaml import yaml_dump_typed

from robots.description.model import RobotModel


def robot_text(robot: RobotModel) -> str:
    """The robot as YAML with all digits of its numbers."""
    return str(yaml_dump_typed(robot))
