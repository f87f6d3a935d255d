"""Writes a robot as a file that `robots.description.model.load_robot` reads back, number for number."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_dump

from robots.description.model import RobotModel


def robot_text(robot: RobotModel) -> str:
    """The robot as YAML with all digits of its numbers."""
    return str(yaml_dump(_plain(robot)))


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {entry.name: _plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, (list, np.ndarray)):
        return [_plain(entry) for entry in value]
    return value.item() if isinstance(value, np.generic) else value
