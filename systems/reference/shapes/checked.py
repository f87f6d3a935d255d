"""Refuses a curve that was made in code, as `robots.configuration` refuses one that was read from a file."""

from typing import Any

from robots.configuration.quantity import dotted, out_of_range
from systems.reference.segment import require_vectors


def checked(curve: Any) -> None:
    """Raises ValueError if a number of a closed curve is out of its range, or a vector has not three."""
    found = out_of_range(curve)
    if found:
        keys, reason = found
        raise ValueError(f"reference: {curve.kind} {dotted(keys)} {reason}")
    require_vectors(curve.kind, curve, "center_mm", "plane_zyx_deg", "zyx_deg")
    if curve.turns != int(curve.turns):
        raise ValueError(f"reference: {curve.kind} turns must be a whole number, got {curve.turns}")
