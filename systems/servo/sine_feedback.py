"""Feedback of the pose error e-bar through L, in closed form."""

import math
from collections.abc import Sequence

from robots.pose import Rows, sine_error_of_rows

_SMALLEST_COSINE = math.cos(math.radians(60.0))  # L is singular at 90 degrees


def sine_feedback(
    wanted: Rows, seen: Rows, V_WD: Sequence[float], rotation: float, translation: float
) -> list[float]:
    """L^-1 (L^T V_d + K e-bar) - V_d, what feedback adds to V_d in Probst (2024) eq. (5.8), L corrected.

    L has the closed-form solutions L^-1 L^T w = (R R_d^T) w and L^-1 e-bar = e-bar / cos(angle). Beyond 60
    degrees L = I, which is its limit for small errors: the tool is then still turned the shorter way round.

    Args:
        wanted, seen: poses, rows of homogeneous matrices.
        V_WD: the wanted twist, rad/s and m/s.
        rotation, translation: gains in 1/s.
    """
    (*sine_error, x, y, z), cosine = sine_error_of_rows(wanted, seen)
    if cosine > _SMALLEST_COSINE:
        w, gain = V_WD[:3], rotation / cosine
        turned = _turned_along(w, wanted, seen)
        turn = [gain * e + b - a for e, b, a in zip(sine_error, turned, w, strict=True)]
    else:
        turn = [rotation * e for e in sine_error]
    return [*turn, translation * x, translation * y, translation * z]


def _turned_along(w: Sequence[float], wanted: Rows, seen: Rows) -> list[float]:
    """(R R_d^T) w."""
    x, y, z = w
    (a0, a1, a2, *_), (b0, b1, b2, *_), (c0, c1, c2, *_) = wanted
    u, v, t = a0 * x + b0 * y + c0 * z, a1 * x + b1 * y + c1 * z, a2 * x + b2 * y + c2 * z
    return [row[0] * u + row[1] * v + row[2] * t for row in seen]
