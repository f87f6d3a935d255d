"""What stands in a cell beside the robot, and the volume in which people are looked for, from a YAML file."""

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from robots.configuration.quantity import quantity, vector
from robots.description.placement import Placement
from systems.vision.data_file import Problem, load_data_file


@dataclass
class Furniture:
    """A box that stands still: fence, cabinet, pedestal."""

    name: str = ""
    size: np.ndarray = vector((1.0, 1.0, 1.0), 0.0, unit="m", is_open=True)  # edges along its own axes
    placement: Placement = field(default_factory=Placement)  # of its centre in the world
    color: np.ndarray = vector((0.5, 0.5, 0.5), 0.0, 1.0)  # red, green and blue

    @property
    def corners(self) -> np.ndarray:
        """Its corners in the world in m, (8, 3)."""
        signs = np.array(list(product((-0.5, 0.5), repeat=3)))
        X = self.placement.pose()
        return (signs * self.size) @ X.rotation().matrix().T + X.translation()


@dataclass
class Surroundings:
    """The still part of a cell. Load one with `load_surroundings`."""

    name: str = ""
    floor: float = quantity(-0.5, unit="m")  # its height in the world
    low: np.ndarray = vector((-3.2, -3.2, -0.5), unit="m")  # corners of the volume that is watched
    high: np.ndarray = vector((3.2, 3.2, 1.5), unit="m")
    furniture: list[Furniture] = field(default_factory=list)


def load_surroundings(name: str) -> Surroundings:
    """Reads shipped surroundings by name (``"probst"``) or any such file by its path.

    Raises:
        ValueError: if there is no such file or it describes none; one line that names file and line.
    """
    return load_data_file(name, "surroundings", Surroundings, _problem)


def _problem(surroundings: Surroundings) -> Problem | None:
    low, high = surroundings.low, surroundings.high
    if not np.all(low < high):
        return ["low"], f"low must be below high along each axis, got {low} and {high} m"
    return None


def behind(furniture: Furniture, eye: np.ndarray, p_W: np.ndarray) -> np.ndarray:
    """Whether a box hides points (n, 3) from an eye (3,), in m; points within it are hidden, too.

    A line of sight is cut by the three pairs of faces; it meets the box where the three spans overlap.
    """
    X = furniture.placement.pose()
    R, half = X.rotation().matrix(), 0.5 * furniture.size
    start, way = (eye - X.translation()) @ R, (p_W - eye) @ R
    with np.errstate(divide="ignore", invalid="ignore"):
        to_low, to_high = (-half - start) / way, (half - start) / way
    enter = np.fmin(to_low, to_high).max(axis=1)
    leave = np.fmax(to_low, to_high).min(axis=1)
    return (enter < leave) & (leave > 0.0) & (enter < 1.0)
