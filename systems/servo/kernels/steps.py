"""What laws work out in every tick, compiled by numba. Poses are the first three rows of matrices, (3, 4).

numba takes a third of a second to import: a law imports this module when it is made, not before.
"""

import math

import numpy as np

from robots.compiled import compiled
from robots.kinematics.kernels import robust_solve
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
def follow_path(X_WD, V_WD, X_WE, J):
    """Motions of the joints as columns, (6, 2): the step in rad from X_WE to X_WD, the rates for V_WD."""
    return robust_solve(J, _to_path(X_WD, V_WD, X_WE))


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
    twists, rates, nowhere = _to_path(X_WD, V_WD, X_WE), np.empty((6, 2)), np.zeros(6)
    for k in range(2):
        rates[:, k] = bounded_rates(J, twists[:, k].copy(), nowhere)
    return rates


@compiled
def _to_path(X_WD, V_WD, X_WE):
    twists, way = np.empty((6, 2)), np.empty(6)
    error(X_WD, X_WE, way)
    for i in range(6):
        twists[i, 0], twists[i, 1] = way[i], V_WD[i]
    return twists


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
    twists = _to_path(X_WD, V_WD, X_WE)
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
def numerical_ik(
    X_WD, V_WD, wanted, seen, is_seen, X_WE, J, memory, gains, limits, period, following, correction
):
    """One step of `systems.servo.numerical_ik.NumericalIk`.

    Args:
        X_WD, V_WD: wanted pose and twist.
        wanted, seen: poses at an exposure; only if something ``is_seen``.
        X_WE, J: pose and Jacobian at the joints halfway.
        memory: of the last tick, (24,).
        gains: of rotation and translation in 1/s.
        limits: of the correction in rad and m.
        period: of a tick in s.
        following: (24,), which becomes the memory of the next tick.
        correction: (6,), which becomes the correction.

    Returns:
        The squared step of the joints on the path in rad^2.
    """
    twist = V_WD.copy()
    for i in range(6):
        correction[i] = 0.0
        for k in range(6):
            correction[i] += J[i, k] * (memory[6 + k] - memory[k])
    if is_seen:
        feedback = sine_feedback(wanted, seen, V_WD, gains[0], gains[1])
        limit_twist(feedback, correction, limits[0], limits[1])
        for i in range(6):
            twist[i] += feedback[i]
    rates, step = follow_path(X_WD, twist, X_WE, J), 0.0
    for i in range(6):
        on_path = memory[18 + i] + rates[i, 0]
        step += (on_path - memory[i]) ** 2
        commanded = memory[6 + i] + 0.5 * period * (rates[i, 1] + memory[12 + i])
        following[i], following[6 + i], following[12 + i] = on_path, commanded, rates[i, 1]
        following[18 + i] = 0.5 * (commanded + on_path) + period * rates[i, 1]
    return step


@compiled
def numerical_ik_at_singularity(
    X_WD,
    V_WD,
    wanted,
    seen,
    is_seen,
    nominal,
    commanded,
    J,
    closeness,
    memory,
    gains,
    limits,
    period,
    following,
    correction,
):
    """`numerical_ik` where the commanded joints are nearly singular, and those halfway say little of them.

    Args:
        X_WD, V_WD, wanted, seen, is_seen: as there.
        nominal: pose and Jacobian at the joints on the path.
        commanded: pose and Jacobian at the commanded joints.
        J: Jacobian at the joints halfway.
        closeness: of the commanded joints; from a half on they count alone.
        memory, gains, limits, period, following, correction: as there.

    Returns:
        As there.
    """
    twist, step = V_WD.copy(), 0.0
    error(commanded[0], X_WD, correction)
    if is_seen:
        feedback = sine_feedback(wanted, seen, V_WD, gains[0], gains[1])
        limit_twist(feedback, correction, limits[0], limits[1])
        for i in range(6):
            twist[i] += feedback[i]
    on_path = bounded_path(X_WD, V_WD, nominal[0], nominal[1])
    back = gains[1] * (memory[:6] - memory[6:12])
    share, halfway = min(1.0, 2.0 * closeness), follow_path(X_WD, twist, X_WD, J)
    rates = share * bounded_rates(commanded[1], twist, back) + (1.0 - share) * halfway[:, 1]
    for i in range(6):
        # One Newton step at its own place, and on to the next tick.
        q_d = memory[i] + on_path[i, 0]
        q_c = memory[6 + i] + period * rates[i]
        step += (q_d + period * on_path[i, 1] - memory[i]) ** 2
        following[i], following[6 + i], following[12 + i] = q_d + period * on_path[i, 1], q_c, rates[i]
        following[18 + i] = 0.5 * (q_c + q_d) + 0.5 * period * (rates[i] + on_path[i, 1])
    return step


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


@compiled
def corrected_pose(
    X_WD, V_WD, wanted, seen, is_seen, memory, gains, limits, period, X_WC, V_WC, kept, correction
):
    """What `systems.servo.position_level.PositionLevel` commands with rotation vectors.

    Args:
        X_WD, V_WD: wanted pose and twist.
        wanted, seen: poses at an exposure; only if something ``is_seen``.
        memory: of the last tick, of which the first six are the correction: rotation vector and shift.
        gains: of rotation and translation in 1/s.
        limits: of the correction in rad and m.
        period: of a tick in s.
        X_WC, V_WC: (3, 4) and (6,), which become the pose and the twist to command.
        kept, correction: (6,) each, which become the correction that is remembered, and the same in the
            world.
    """
    rate, gap = np.zeros(6), np.empty(6)
    kept[:] = memory[:6]
    C, step, both = np.zeros((3, 4)), np.empty((3, 3)), np.zeros((3, 4))
    if is_seen:
        error(wanted, seen, gap)
        for i in range(3):
            for k in range(3):
                rate[i] += gains[0] * gap[k] * seen[k, i]
            rate[3 + i] = gains[1] * gap[3 + i]
            kept[3 + i] += period * rate[3 + i]
        turned_by(kept[:3], C[:, :3])
        turned_by(period * rate[:3], step)
        for i in range(3):
            for j in range(3):
                both[i, j] = C[i, 0] * step[0, j] + C[i, 1] * step[1, j] + C[i, 2] * step[2, j]
        error(both, np.eye(4)[:3], gap)
        kept[:3] = gap[:3]
    for part in range(2):
        first = 3 * part
        size = math.sqrt(kept[first] ** 2 + kept[first + 1] ** 2 + kept[first + 2] ** 2)
        if size > limits[part]:
            for i in range(first, first + 3):
                kept[i] *= limits[part] / size
    turned_by(kept[:3], C[:, :3])
    V_WC[:], correction[:] = V_WD, kept
    for i in range(3):
        X_WC[i, 3] = X_WD[i, 3] + kept[3 + i]
        V_WC[3 + i] += rate[3 + i]
        correction[i] = 0.0
        for j in range(3):
            X_WC[i, j] = X_WD[i, 0] * C[0, j] + X_WD[i, 1] * C[1, j] + X_WD[i, 2] * C[2, j]
            V_WC[i] += X_WC[i, j] * rate[j]
            correction[i] += X_WD[i, j] * kept[j]


def warm_up() -> None:
    """Calls everything once with arrays as a tick has them, so that no tick waits for a compiler."""
    X, J, V = np.eye(4)[:3].copy(), np.eye(6), np.zeros(6)
    distance(X, X)
    limit_twist(sine_feedback(X, X, V, 1.0, 1.0), V, 1.0, 1.0)
    follow_path(X, V, X, J)
    bounded_path(X, V, X, J)
    newton_step(X, V, X, J, V, V, np.zeros(12))
    robust_solve(J, V[:, None])
    error(X, X, np.empty(6))
    rest = np.zeros(24), (1.0, 1.0), (1.0, 1.0), 1.0, np.zeros(24), V.copy()
    numerical_ik(X, V, X, X, True, X, J, *rest)
    places = (X, J), (X, J), J, closeness(J)
    numerical_ik_at_singularity(X, V, X, X, True, *places, *rest)
    found = X.copy(), V.copy(), V.copy(), V.copy()
    corrected_pose(X, V, X, X, True, np.zeros(24), (1.0, 1.0), (1.0, 1.0), 1.0, *found)
