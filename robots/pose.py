"""Orientations and distances between poses: ZYX Euler angles, the errors e and e-bar and their rates.

Poses are homogeneous matrices of shape (..., 4, 4), rotations (..., 3, 3); every function takes a whole
batch. Errors are spatial vectors with the rotation first, as Drake has them (the source puts it last).

The functions that control laws call in every tick take a short way for a single pose: plain floats cost
a few microseconds where the array operations below cost tens.
"""

import math
from collections.abc import Sequence

import numpy as np

Floats = tuple[float, float, float]
# A rotation or a pose as lists of floats: its first three rows, of which the pose's have a fourth column.
Rows = Sequence[Sequence[float]]

# Below this cosine of beta the ZYX angles alpha and gamma cannot be told apart.
GIMBAL_LOCK = 1e-13  # far above rounding, far below what anyone measures
# Where the sine of the angle is this small (and the angle not), it no longer shows the axis accurately.
_HALF_TURN_SINE = 1e-2


def wrap_angle(angle: np.ndarray) -> np.ndarray:
    """Angles in rad brought to (-pi, pi]; angles that are there already are returned as they are."""
    angle = np.asarray(angle, dtype=float)
    wrapped = angle - 2.0 * np.pi * np.ceil((angle - np.pi) / (2.0 * np.pi))
    # For large angles the rounding of the quotient can lead just past either end.
    return np.where(wrapped <= -np.pi, np.pi, np.minimum(wrapped, np.pi))[()]


def rotation_from_zyx(zyx: np.ndarray) -> np.ndarray:
    """Rotation matrices exp(z alpha) exp(y beta) exp(x gamma), Probst (2024) eq. (2.7).

    Args:
        zyx: angles (alpha, beta, gamma) in rad, shape (..., 3).

    Returns:
        Rotation matrices, shape (..., 3, 3).
    """
    zyx = np.asarray(zyx, dtype=float)
    if zyx.ndim == 1:
        return np.array(rotation_rows(zyx.tolist()))
    ca, cb, cg = np.moveaxis(np.cos(zyx), -1, 0)
    sa, sb, sg = np.moveaxis(np.sin(zyx), -1, 0)
    return np.stack(
        [
            np.stack([ca * cb, ca * sb * sg - sa * cg, ca * sb * cg + sa * sg], -1),
            np.stack([sa * cb, sa * sb * sg + ca * cg, sa * sb * cg - ca * sg], -1),
            np.stack([-sb, cb * sg, cb * cg], -1),
        ],
        -2,
    )


def rotation_rows(zyx: Sequence[float]) -> tuple[Floats, Floats, Floats]:
    """`rotation_from_zyx` of one orientation, as rows."""
    alpha, beta, gamma = zyx
    ca, cb, cg = math.cos(alpha), math.cos(beta), math.cos(gamma)
    sa, sb, sg = math.sin(alpha), math.sin(beta), math.sin(gamma)
    return (
        (ca * cb, ca * sb * sg - sa * cg, ca * sb * cg + sa * sg),
        (sa * cb, sa * sb * sg + ca * cg, sa * sb * cg - ca * sg),
        (-sb, cb * sg, cb * cg),
    )


def zyx_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """The inverse of `rotation_from_zyx` with beta in [-pi/2, pi/2].

    At beta = +-pi/2 only alpha -+ gamma is defined; gamma is zero there. Close to it alpha is uncertain,
    but gamma is computed from the rest of the rotation, so that the three angles always reproduce it.

    Args:
        rotation: rotation matrices, shape (..., 3, 3).

    Returns:
        Angles (alpha, beta, gamma) in rad, shape (..., 3).
    """
    if rotation.ndim == 2:
        return np.array(zyx_angles(rotation.tolist()))
    r = np.asarray(rotation)
    cos_beta = np.hypot(r[..., 0, 0], r[..., 1, 0])
    regular = np.arctan2(r[..., 1, 0], r[..., 0, 0])
    alpha = np.where(cos_beta > GIMBAL_LOCK, regular, np.arctan2(-r[..., 0, 1], r[..., 1, 1]))
    sa, ca = np.sin(alpha), np.cos(alpha)
    gamma = np.arctan2(sa * r[..., 0, 2] - ca * r[..., 1, 2], ca * r[..., 1, 1] - sa * r[..., 0, 1])
    return np.stack([alpha, np.arctan2(-r[..., 2, 0], cos_beta), gamma], -1)


def zyx_angles(rows: Rows) -> Floats:
    """`zyx_from_rotation` of one rotation given as rows; what follows in a row, as in a pose, is ignored."""
    (r00, r01, r02, *_), (r10, r11, r12, *_), (r20, *_), *_ = rows
    cos_beta = math.hypot(r00, r10)
    alpha = math.atan2(r10, r00) if cos_beta > GIMBAL_LOCK else math.atan2(-r01, r11)
    sa, ca = math.sin(alpha), math.cos(alpha)
    gamma = math.atan2(sa * r02 - ca * r12, ca * r11 - sa * r01)
    return alpha, math.atan2(-r20, cos_beta), gamma


def euler_rate_matrix(zyx: np.ndarray) -> np.ndarray:
    """T with w = T d/dt (alpha, beta, gamma), the rotational part of Probst (2024) eq. (5.12).

    Singular at beta = +-pi/2, where the Euler angles are.

    Returns:
        Matrices of shape (..., 3, 3).
    """
    zyx = np.asarray(zyx, dtype=float)
    if zyx.ndim == 1:
        alpha, beta, _ = zyx.tolist()
        ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
        return np.array([[0.0, -sa, ca * cb], [0.0, ca, sa * cb], [1.0, 0.0, -sb]])
    ca, sa = np.cos(zyx[..., 0]), np.sin(zyx[..., 0])
    cb, sb = np.cos(zyx[..., 1]), np.sin(zyx[..., 1])
    zero, one = np.zeros_like(ca), np.ones_like(ca)
    return np.stack(
        [
            np.stack([zero, -sa, ca * cb], -1),
            np.stack([zero, ca, sa * cb], -1),
            np.stack([one, zero, -sb], -1),
        ],
        -2,
    )


def euler_difference(zyx_D: Sequence[float], zyx_E: Sequence[float]) -> Floats:
    """Wrapped differences of the angles of two orientations, wanted minus seen, in rad."""
    (a, b, c), (d, e, f) = zyx_D, zyx_E
    turn = 2.0 * math.pi
    return math.remainder(a - d, turn), math.remainder(b - e, turn), math.remainder(c - f, turn)


def angular_velocity(zyx: Sequence[float], rates: Sequence[float]) -> Floats:
    """w = T(zyx) rates for one orientation, see `euler_rate_matrix`; in rad and rad/s."""
    (alpha, beta, _), (alpha_rate, beta_rate, gamma_rate) = zyx, rates
    ca, sa, cb = math.cos(alpha), math.sin(alpha), math.cos(beta)
    return (
        ca * cb * gamma_rate - sa * beta_rate,
        sa * cb * gamma_rate + ca * beta_rate,
        alpha_rate - math.sin(beta) * gamma_rate,
    )


def euler_rates(zyx: Sequence[float], w: Sequence[float]) -> Floats:
    """The inverse of `angular_velocity`.

    Raises:
        ZeroDivisionError: at beta = +-pi/2 exactly, where the rates are not defined.
    """
    (alpha, beta, _), (x, y, z) = zyx, w
    ca, sa = math.cos(alpha), math.sin(alpha)
    gamma_rate = (ca * x + sa * y) / math.cos(beta)
    return z + math.sin(beta) * gamma_rate, ca * y - sa * x, gamma_rate


def _skew_part(m: np.ndarray) -> np.ndarray:
    """The vector v with v-tilde = (m - m^T) / 2."""
    return 0.5 * np.stack(
        [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], -1
    )


def _angle_over_sine(x: float, y: float, z: float, cosine: float) -> float | None:
    """The angle over its sine, for the axis times the sine; None near half a turn, where it is of no use."""
    sine = math.sqrt(x * x + y * y + z * z)
    if cosine < 0.0 and sine < _HALF_TURN_SINE:
        return None
    return math.atan2(sine, cosine) / sine if sine > 0.0 else 1.0


def rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Axis times angle of rotation matrices, angle in [0, pi], Probst (2024) eqs. (2.37) to (2.39).

    The source divides by the sine of the angle; near 180 degrees the axis is read from the symmetric part
    instead, so that the result is accurate for every angle. At 180 degrees either of the two axes results.

    Args:
        rotation: rotation matrices, shape (..., 3, 3).

    Returns:
        Rotation vectors in rad, shape (..., 3).
    """
    r = np.asarray(rotation, dtype=float)
    if r.ndim == 2:
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = r.tolist()
        x, y, z = 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)
        scale = _angle_over_sine(x, y, z, 0.5 * (xx + yy + zz - 1.0))
        if scale is not None:
            return np.array([scale * x, scale * y, scale * z])
    axis_sine = _skew_part(r)
    sine = np.linalg.norm(axis_sine, axis=-1)
    cosine = 0.5 * (np.trace(r, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    vector = axis_sine * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)[..., None]
    half_turn = (cosine < 0.0) & (sine < _HALF_TURN_SINE)
    if np.any(half_turn):
        symmetric = 0.5 * (r + np.swapaxes(r, -1, -2)) - np.asarray(cosine)[..., None, None] * np.eye(3)
        column = np.argmax(np.einsum("...ii->...i", symmetric), axis=-1)
        axis = np.take_along_axis(symmetric, column[..., None, None], axis=-1)[..., 0]
        axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
        sign = np.where(np.sum(axis * axis_sine, -1) < 0.0, -1.0, 1.0)
        vector = np.where(half_turn[..., None], axis * (sign * angle)[..., None], vector)
    return vector


def _relative_rotation(X_WD: np.ndarray, X_WE: np.ndarray) -> np.ndarray:
    return X_WD[..., :3, :3] @ np.swapaxes(X_WE[..., :3, :3], -1, -2)


def sine_error_of_rows(X_WD: Rows, X_WE: Rows) -> tuple[list[float], float]:
    """`sine_pose_error` of one pair of poses given as rows, and the cosine of the angle between them."""
    (a0, a1, a2, ax), (b0, b1, b2, bx), (c0, c1, c2, cx), *_ = X_WD
    (d0, d1, d2, dx), (e0, e1, e2, ex), (f0, f1, f2, fx), *_ = X_WE
    error = [
        0.5 * (c0 * e0 + c1 * e1 + c2 * e2 - b0 * f0 - b1 * f1 - b2 * f2),
        0.5 * (a0 * f0 + a1 * f1 + a2 * f2 - c0 * d0 - c1 * d1 - c2 * d2),
        0.5 * (b0 * d0 + b1 * d1 + b2 * d2 - a0 * e0 - a1 * e1 - a2 * e2),
        ax - dx,
        bx - ex,
        cx - fx,
    ]
    trace = a0 * d0 + a1 * d1 + a2 * d2 + b0 * e0 + b1 * e1 + b2 * e2 + c0 * f0 + c1 * f1 + c2 * f2
    return error, 0.5 * (trace - 1.0)


def pose_error(X_WD: np.ndarray, X_WE: np.ndarray) -> np.ndarray:
    """The distance e from a pose to the wanted pose D, Probst (2024) eqs. (2.36), (2.37).

    Args:
        X_WD, X_WE: homogeneous matrices, shape (..., 4, 4).

    Returns:
        (rotation vector in rad, translation in m) in the world, shape (..., 6).
    """
    if X_WD.ndim == 2 and X_WE.ndim == 2:
        return np.array(error_of_rows(X_WD.tolist(), X_WE.tolist()))
    R_error = _relative_rotation(X_WD, X_WE)
    return np.concatenate([rotation_vector(R_error), X_WD[..., :3, 3] - X_WE[..., :3, 3]], -1)


def error_of_rows(X_WD: Rows, X_WE: Rows) -> list[float]:
    """`pose_error` of one pair of poses given as rows."""
    (x, y, z, *way), cosine = sine_error_of_rows(X_WD, X_WE)
    scale = _angle_over_sine(x, y, z, cosine)
    if scale is None:
        turn = rotation_vector(_relative_rotation(np.array(X_WD), np.array(X_WE)))
        return [*turn.tolist(), *way]
    return [scale * x, scale * y, scale * z, *way]


def sine_pose_error(X_WD: np.ndarray, X_WE: np.ndarray) -> np.ndarray:
    """The distance e-bar, with the sine of the angle in place of the angle, Probst (2024) eq. (2.40).

    Args:
        X_WD, X_WE: homogeneous matrices, shape (..., 4, 4).

    Returns:
        (axis times sine of the angle, translation in m) in the world, shape (..., 6).
    """
    if X_WD.ndim == 2 and X_WE.ndim == 2:
        return np.array(sine_error_of_rows(X_WD.tolist(), X_WE.tolist())[0])
    R_error = _relative_rotation(X_WD, X_WE)
    return np.concatenate([_skew_part(R_error), X_WD[..., :3, 3] - X_WE[..., :3, 3]], -1)


def sine_error_rate_matrix(R_WD: np.ndarray, R_WE: np.ndarray) -> np.ndarray:
    """L_O with d/dt e-bar_O = L_O^T w_D - L_O w_E.

    Probst (2024) eqs. (2.41) to (2.46), corrected: L_O = (tr(R R_d^T) I - R R_d^T) / 2. Its determinant is
    cos(angle) (1 + cos(angle)) / 2, so it cannot be inverted at 90 and 180 degrees.

    Args:
        R_WD, R_WE: rotation matrices, shape (..., 3, 3).

    Returns:
        Matrices of shape (..., 3, 3).
    """
    relative = R_WE @ np.swapaxes(R_WD, -1, -2)
    if relative.ndim == 2:
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = relative.tolist()
        return 0.5 * np.array([[yy + zz, -xy, -xz], [-yx, xx + zz, -yz], [-zx, -zy, xx + yy]])
    return 0.5 * (np.trace(relative, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - relative)
