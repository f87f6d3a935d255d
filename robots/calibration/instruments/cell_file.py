"""What is known of targets and instruments before a measurement, read from a YAML file."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robots.calibration.instruments.observations import MeasuringCell
from robots.configuration.nodes import read_nodes
from robots.configuration.quantity import named, quantity
from robots.configuration.typed import typed
from robots.pose import rotation_from_zyx


@dataclass
class CellFile:
    """The file, field for field; a target or an instrument that it does not name is to be found."""

    targets: dict[str, np.ndarray] = named(3, unit="mm")  # their places on the tool
    # World of the robot in the frame of an instrument: x, y, z in mm, alpha, beta, gamma in degrees (ZYX)
    frames: dict[str, np.ndarray] = named(6)
    anchors: dict[str, np.ndarray] = named(3, unit="mm")  # of distances, in the world
    sigma_mm: dict[str, float] = named(low=0.0, unit="mm", is_open=True)  # of instruments
    joint_sigma_deg: float | None = quantity(None, 0.0, unit="deg")


def read_cell(path: str | Path) -> MeasuringCell:
    """Reads what is known of targets and instruments, a `CellFile`.

    Raises:
        ConfigurationError: if it cannot be read, or says something else; one line with file and line.
    """
    found = typed(read_nodes(Path(path), f"cell {path}"), CellFile)
    joint = found.joint_sigma_deg
    return MeasuringCell(
        {name: 1e-3 * place for name, place in found.targets.items()},
        {name: _frame(numbers) for name, numbers in found.frames.items()},
        {name: 1e-3 * place for name, place in found.anchors.items()},
        {name: 1e-3 * sigma for name, sigma in found.sigma_mm.items()},
        None if joint is None else math.radians(joint),
    )


def _frame(numbers: np.ndarray) -> np.ndarray:
    """The pose (4, 4) in m of three lengths in mm and three angles in degrees."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = rotation_from_zyx(np.deg2rad(numbers[3:])), 1e-3 * numbers[:3]
    return X
