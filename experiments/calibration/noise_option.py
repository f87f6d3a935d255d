"""``--noise``: what is known of the noise of the rows, and what a simulation adds to them."""

import math
from pathlib import Path

import yaml

from robots.calibration.measurements import SOURCE_NOISE, MeasurementNoise

ESTIMATE = "estimate"
_NAMED = {ESTIMATE: MeasurementNoise(), "source": SOURCE_NOISE}
_ROTATION = "rotation_deg"
_KEYS = ("joint_deg", "position_mm", _ROTATION)


def noise_option(text: str, has_rotation: bool) -> MeasurementNoise:
    """The noise that is known; none where it is to be estimated.

    Args:
        text: ``estimate``, ``source`` for that of Probst (2024), table 6.1, or the path of a YAML file with
            the standard deviations ``joint_deg``, ``position_mm`` and, where orientations are measured,
            ``rotation_deg``.
        has_rotation: whether they are.

    Raises:
        ValueError: if it is none of these, or the file does not hold these numbers, or no sensible ones.
    """
    if text in _NAMED:
        return _NAMED[text]
    path = Path(text)
    if not path.is_file():
        raise ValueError(f"--noise must be estimate, source or the path of a YAML file, got '{text}'")
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ValueError(f"--noise {text}: cannot be read: {' '.join(str(error).split())}") from error
    if not isinstance(found, dict) or {_ROTATION, *found} != set(_KEYS):
        there = ", ".join(map(str, found)) if isinstance(found, dict) else "something else"
        raise ValueError(f"--noise {text}: must have exactly {', '.join(_KEYS)}, there is {there}")
    if has_rotation and _ROTATION not in found:
        raise ValueError(
            f"--noise {text}: needs {_ROTATION}, as orientations are measured; or give --position-only"
        )
    for key, value in found.items():
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
        if not is_number or value < 0.0 or (value == 0.0 and key != "joint_deg"):
            least = "not be negative" if key == "joint_deg" else "be positive"
            raise ValueError(f"--noise {text}: {key} must {least}, got {value}")
    joint, position, rotation = (float(found.get(key, 0.0)) for key in _KEYS)
    return MeasurementNoise(math.radians(joint), 1e-3 * position, math.radians(rotation))
