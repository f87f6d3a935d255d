"""What stands around a robot: boxes of a YAML file, which an arm that measures keeps clear of."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robots.configuration.nodes import read_nodes
from robots.configuration.quantity import vector
from robots.configuration.typed import typed
from robots.description.placement import Placement


@dataclass
class Obstacle:
    """A box in the world."""

    name: str = ""
    size: np.ndarray = vector((1.0, 1.0, 1.0), 0.0, unit="m", is_open=True)  # edges along its own axes
    placement: Placement = field(default_factory=Placement)  # of its centre


@dataclass
class Obstacles:
    """A file of obstacles."""

    obstacles: list[Obstacle] = field(default_factory=list)


def read_obstacles(name: str) -> tuple[Obstacle, ...]:
    """The boxes of a YAML file.

    Raises:
        ConfigurationError: if it cannot be read; one line with file and line.
    """
    return tuple(typed(read_nodes(Path(name), f"obstacles {name}"), Obstacles).obstacles)
