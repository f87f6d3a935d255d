"""Pieces of a path: sums of five functions of one parameter s, whose derivatives by time follow."""

import math
from typing import NamedTuple

import numpy as np

from robots.pose import rotation_from_zyx, rotation_vector


class Segment(NamedTuple):
    """A piece of a path as a sum of the five functions 1, s, sin(a s), cos(a s) and sin(2 a s).

    They span all that is needed: straight lines with a rotation about a fixed axis, circles, figure eights.
    """

    angle: float  # a in rad
    pose: np.ndarray  # (5, 16), the coefficients of the entries of X_WE, row by row
    twist: np.ndarray  # (4, 6), of the last four functions: (rotation vector, translation) in rad and m


def segment(
    angle: float, rotation: dict[int, np.ndarray], translation: dict[int, np.ndarray], turn: np.ndarray
) -> Segment:
    """Puts coefficients in their places; ``turn`` is dR/ds R^T as a vector, constant, in rad."""
    pose, twist = np.zeros((5, 4, 4)), np.zeros((5, 6))
    pose[0, 3, 3] = 1.0
    for i, matrix in rotation.items():
        pose[i, :3, :3] = matrix
    for i, vector in translation.items():
        pose[i, :3, 3] = vector
        twist[i, 3:] = vector
    twist[1, :3] = turn
    return Segment(angle, pose.reshape(5, 16), twist[1:])


def line(X_start: np.ndarray, X_end: np.ndarray) -> Segment:
    """From pose to pose (both (4, 4)) for s from 0 to 1: straight, turning about an axis fixed in the world.

    Probst (2024), eqs. (5.3) and (5.4), corrected: R(s) = exp(e~ phi s) R_start. As e does not move, eq.
    (5.6) comes down to w = e phi ds/dt.
    """
    R = X_start[:3, :3]
    turn = rotation_vector(X_end[:3, :3] @ R.T)
    angle = float(np.linalg.norm(turn))
    skew = np.cross(np.eye(3), turn / angle if angle > 0.0 else turn)
    rotation = {0: R + skew @ skew @ R, 2: skew @ R, 3: -skew @ skew @ R}
    return segment(angle, rotation, {0: X_start[:3, 3], 1: X_end[:3, 3] - X_start[:3, 3]}, turn)


def weights(angle, s, rate, acceleration, sine, cosine):
    """The five functions, and the first and second time derivative of the last four, by the chain rule."""
    double_sine, double_cosine = 2.0 * sine * cosine, 1.0 - 2.0 * sine * sine
    w, dw = angle * rate, angle * acceleration
    ww = w * w
    return (
        (1.0, s, sine, cosine, double_sine),
        (rate, w * cosine, -w * sine, 2.0 * w * double_cosine),
        (
            acceleration,
            dw * cosine - ww * sine,
            -dw * sine - ww * cosine,
            2.0 * dw * double_cosine - 4.0 * ww * double_sine,
        ),
    )


def rotation(zyx_deg: np.ndarray) -> np.ndarray:
    """The rotation matrix, (3, 3), of ZYX angles (alpha, beta, gamma) in degrees, (3,)."""
    return rotation_from_zyx(np.deg2rad(zyx_deg))


def closed(rotation_WE: np.ndarray, translation: dict[int, np.ndarray]) -> Segment:
    """A closed curve without rotation, a turn for each unit of s.

    Args:
        rotation_WE: of the tool, constant, shape (3, 3).
        translation: by the number of the function its coefficient in m, shape (3,).
    """
    return segment(2.0 * math.pi, {0: rotation_WE}, translation, np.zeros(3))


def require_vectors(where: str, part: object, *names: str) -> None:
    """Raises ValueError unless these fields are three finite numbers each."""
    for name in names:
        value = np.asarray(getattr(part, name), dtype=float)
        if value.shape != (3,) or not np.all(np.isfinite(value)):
            raise ValueError(f"reference: {where} {name} must be three finite numbers, got {value.tolist()}")
