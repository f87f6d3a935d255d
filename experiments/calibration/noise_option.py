"""``--noise``: what is known of the noise of the rows, and what a simulation adds to them."""

import math
from dataclasses import dataclass
from pathlib import Path

from robots.calibration.measurements import SOURCE_NOISE, MeasurementNoise
from robots.configuration.nodes import read_nodes
from robots.configuration.quantity import positive, quantity
from robots.configuration.typed import typed

ESTIMATE = "estimate"
_NAMED = {ESTIMATE: MeasurementNoise(), "source": SOURCE_NOISE}


@dataclass
class NoiseFile:
    """Standard deviations, field for field as in the file."""

    joint_deg: float | None = quantity(None, 0.0, unit="deg")
    position_mm: float | None = positive(None, unit="mm")
    rotation_deg: float | None = positive(None, unit="deg")  # where orientations are measured


def noise_option(text: str, has_rotation: bool) -> MeasurementNoise:
    """The noise that is known; none where it is to be estimated.

    Args:
        text: ``estimate``, ``source`` for that of Probst (2024), table 6.1, or the path of a `NoiseFile`.
        has_rotation: whether orientations are measured.

    Raises:
        ValueError: if it is none of these, or the file does not hold these numbers, or no sensible ones.
    """
    if text in _NAMED:
        return _NAMED[text]
    path = Path(text)
    if not path.is_file():
        raise ValueError(f"--noise must be estimate, source or the path of a YAML file, got '{text}'")
    found = typed(read_nodes(path, f"--noise {text}"), NoiseFile)
    if found.joint_deg is None or found.position_mm is None:
        missing = "joint_deg" if found.joint_deg is None else "position_mm"
        raise ValueError(f"--noise {text}: needs {missing}")
    if has_rotation and found.rotation_deg is None:
        raise ValueError(
            f"--noise {text}: needs rotation_deg, as orientations are measured; or give --position-only"
        )
    rotation = math.radians(found.rotation_deg or 0.0)
    return MeasurementNoise(math.radians(found.joint_deg), 1e-3 * found.position_mm, rotation)
