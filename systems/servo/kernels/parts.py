"""What the steps of laws are made of, compiled by numba. Poses are rows of matrices, (3, 4)."""

import math

import numpy as np

from robots.compiled import compiled
from robots.kinematics.kernels import robust_solve
from robots.pose import GIMBAL_LOCK
from systems.estimation.kernels.poses import error

_SMALLEST_COSINE = math.cos(math.radians(60.0))  # L is singular at 90 degrees
_NEWTON_STEP = 5e-5  # rad; what one such step leaves is its square, a few nanometres
_DAMPED = 1e-10  # rad and m that a step leaves which was not damped
# Smallest singular value of a Jacobian in rad and m: an elbow is 3 to 8 degrees from stretched there.
NEARLY_SINGULAR = 0.03


@compiled
def distance(wanted, seen):
    """The squared distance of two poses in m^2, and the trace of the rotation between them."""
    gap_squared = trace = 0.0
    for i in range(3):
        gap_squared += (wanted[i, 3] - seen[i, 3]) ** 2
        for j in range(3):
            trace += wanted[i, j] * seen[i, j]
    return gap_squared, trace


@compiled
def limit_twist(twist, correction, angle_limit, limit):
    """Takes from a twist (6,) what makes a correction (6,) larger that stands at its limit in rad or m."""
    for part in range(2):
        largest, first = (angle_limit, 0) if part == 0 else (limit, 3)
        square = along = 0.0
        for i in range(first, first + 3):
            square += correction[i] ** 2
            along += correction[i] * twist[i]
        if square >= largest**2 and along > 0.0:
            for i in range(first, first + 3):
                twist[i] = 0.0


@compiled
def sine_feedback(wanted, seen, V_WD, rotation, translation):
    """L^-1 (L^T V_d + K e-bar) - V_d, what feedback adds to V_d in Probst (2024) eq. (5.8), L corrected.

    L has the closed-form solutions L^-1 L^T w = (R R_d^T) w and L^-1 e-bar = e-bar / cos(angle). Beyond 60
    degrees L = I, which is its limit for small errors: the tool is then still turned the shorter way round.

    Args:
        wanted, seen: poses.
        V_WD: the wanted twist, (6,) in rad/s and m/s.
        rotation, translation: gains in 1/s.

    Returns:
        A twist (6,).
    """
    R = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            R[i, j] = wanted[i, 0] * seen[j, 0] + wanted[i, 1] * seen[j, 1] + wanted[i, 2] * seen[j, 2]
    twist = np.empty(6)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        twist[i] = 0.5 * rotation * (R[k, j] - R[j, k])
        twist[3 + i] = translation * (wanted[i, 3] - seen[i, 3])
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if cosine > _SMALLEST_COSINE:
        for i in range(3):
            turned = R[0, i] * V_WD[0] + R[1, i] * V_WD[1] + R[2, i] * V_WD[2]
            twist[i] = twist[i] / cosine + turned - V_WD[i]
    return twist


@compiled
def to_path(X_WD, V_WD, X_WE):
    """Twists as columns, (6, 2): the error from X_WE to X_WD, and V_WD."""
    twists, way = np.empty((6, 2)), np.empty(6)
    error(X_WD, X_WE, way)
    for i in range(6):
        twists[i, 0], twists[i, 1] = way[i], V_WD[i]
    return twists


@compiled
def follow_path(X_WD, V_WD, X_WE, J):
    """Motions of the joints as columns, (6, 2): the step in rad from X_WE to X_WD, the rates for V_WD."""
    return robust_solve(J, to_path(X_WD, V_WD, X_WE))


@compiled
def closeness(J):
    """How close to a singularity joints are: from 0, outside `NEARLY_SINGULAR`, to 1 in it."""
    # All singular values are larger if J J^T - e^2 I is positive definite, as its Cholesky factor says.
    L, is_outside = np.zeros((6, 6)), True
    for i in range(6):
        for j in range(i + 1):
            total = -(NEARLY_SINGULAR**2) if i == j else 0.0
            for k in range(6):
                total += J[i, k] * J[j, k]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                is_outside = is_outside and total > 0.0
                L[i, i] = math.sqrt(max(total, 1e-12))
            else:
                L[i, j] = total / L[j, j]
    if is_outside:
        return 0.0
    return max(0.0, 1.0 - np.linalg.svd(J)[1][5] / NEARLY_SINGULAR)


@compiled
def bounded_rates(J, twist, back):
    """Joint velocities (6,) at a singularity: for a twist as far as the tool can follow, and back from it.

    By singular values s of J, the twist counts by s / e^2 below e = `NEARLY_SINGULAR` and by 1 / s above, as
    damped least squares have it with the damping e^2 - s^2: feedback ends where the error gets no smaller.
    At a stretched arm either way to bend would be as good; ``back`` says which one it is.

    Args:
        J: Jacobian at the joints.
        twist: of the tool, (6,) in rad/s and m/s.
        back: velocities to joints on the wanted side, (6,) in rad/s, of which 1 - (s / e)^2 counts.
    """
    U, s, Vt = np.linalg.svd(J)
    rates = np.zeros(6)
    for k in range(6):
        along = aside = 0.0
        for i in range(6):
            along += U[i, k] * twist[i]
            aside += Vt[k, i] * back[i]
        along *= s[k] / max(s[k], NEARLY_SINGULAR) ** 2
        along += aside * max(0.0, 1.0 - (s[k] / NEARLY_SINGULAR) ** 2)
        for i in range(6):
            rates[i] += Vt[k, i] * along
    return rates


@compiled
def bounded_path(X_WD, V_WD, X_WE, J):
    """As `follow_path`, by `bounded_rates`: no step leads beyond a stretched arm, to another branch."""
    twists, rates, nowhere = to_path(X_WD, V_WD, X_WE), np.empty((6, 2)), np.zeros(6)
    for k in range(2):
        rates[:, k] = bounded_rates(J, twists[:, k].copy(), nowhere)
    return rates


@compiled
def newton_step(X_WD, V_WD, X_WE, J, lower, upper, joints):
    """One step from joints where the tool is at X_WE to those for a wanted pose and twist.

    Args:
        X_WD, V_WD: where to be.
        X_WE, J: pose and Jacobian at ``joints[:6]``.
        lower, upper: the range of the joints, (6,) rad.
        joints: (12,), positions in rad, to which the step is added, and velocities in rad/s, which are found.

    Returns:
        Whether the step was so small, and so exact, that another one would change nothing.
    """
    twists = to_path(X_WD, V_WD, X_WE)
    rates = robust_solve(J, twists)
    step = left = 0.0
    is_inside = True
    for i in range(6):
        joints[i] += rates[i, 0]
        joints[6 + i] = rates[i, 1]
        is_inside = is_inside and lower[i] <= joints[i] <= upper[i]
        step += rates[i, 0] ** 2
        rest = twists[i, 0]
        for k in range(6):
            rest -= J[i, k] * rates[k, 0]
        left += rest**2
    return is_inside and step <= _NEWTON_STEP**2 and left <= _DAMPED**2


@compiled
def zyx_angles(R):
    """`robots.pose.zyx_angles` of a pose (3, 4)."""
    cos_beta = math.hypot(R[0, 0], R[1, 0])
    alpha = math.atan2(R[1, 0], R[0, 0]) if cos_beta > GIMBAL_LOCK else math.atan2(-R[0, 1], R[1, 1])
    sa, ca = math.sin(alpha), math.cos(alpha)
    gamma = math.atan2(sa * R[0, 2] - ca * R[1, 2], ca * R[1, 1] - sa * R[0, 1])
    return alpha, math.atan2(-R[2, 0], cos_beta), gamma


@compiled
def euler_feedback(wanted, seen, gains):
    """K T(z) (z_d - z_m) of Probst (2024) eq. (5.14), differences of angles wrapped; a twist (6,)."""
    (a, b, c), (alpha, beta, gamma) = zyx_angles(wanted), zyx_angles(seen)
    turn = 2.0 * math.pi
    a, b, c = a - alpha, b - beta, c - gamma
    a, b, c = a - turn * np.rint(a / turn), b - turn * np.rint(b / turn), c - turn * np.rint(c / turn)
    ca, sa, cb = math.cos(alpha), math.sin(alpha), math.cos(beta)
    twist = np.empty(6)
    twist[0] = gains[0] * (ca * cb * c - sa * b)
    twist[1] = gains[0] * (sa * cb * c + ca * b)
    twist[2] = gains[0] * (a - math.sin(beta) * c)
    for i in range(3):
        twist[3 + i] = gains[1] * (wanted[i, 3] - seen[i, 3])
    return twist


@compiled
def turned_by(turn, out):
    """The rotation matrix of a rotation vector (3,) in rad into (3, 3), the Euler-Rodrigues formula."""
    angle = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    scale = angle if angle > 0.0 else 1.0
    x, y, z = turn[0] / scale, turn[1] / scale, turn[2] / scale
    s, v = math.sin(angle), 1.0 - math.cos(angle)
    out[0, 0], out[0, 1], out[0, 2] = 1.0 - v * (y * y + z * z), v * x * y - s * z, v * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = v * x * y + s * z, 1.0 - v * (x * x + z * z), v * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = v * x * z - s * y, v * y * z + s * x, 1.0 - v * (x * x + y * y)
