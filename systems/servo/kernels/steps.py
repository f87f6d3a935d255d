"""What laws work out in every tick, compiled by numba. Poses are the first three rows of matrices, (3, 4).

numba takes a third of a second to import: a law imports this module when it is made, not before.
"""

import math

import numpy as np

from robots.compiled import compiled
from robots.kinematics.kernels import robust_solve
from systems.estimation.kernels.poses import error
from systems.servo.kernels.parts import (
    bounded_path,
    bounded_rates,
    closeness,
    distance,
    euler_feedback,
    follow_path,
    limit_twist,
    newton_step,
    sine_feedback,
    turned_by,
)


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
def pbvs(
    X_WD,
    V_WD,
    wanted,
    seen,
    is_seen,
    nominal,
    reached,
    memory,
    position,
    gains,
    limits,
    period,
    q_d,
    velocity,
    correction,
):
    """One step of `systems.servo.pbvs.Pbvs`.

    Args:
        X_WD, V_WD: wanted pose and twist.
        wanted, seen: poses at an exposure; only if something ``is_seen``.
        nominal: pose and Jacobian at the joints on the path.
        reached: pose and Jacobian at the measured joints.
        memory: the joints on the path, (6,) in rad.
        position: the measured joints, (6,) in rad.
        gains: of rotation and translation in 1/s.
        limits: of the correction in rad and m, of the correction of one joint in rad/s.
        period: of a tick in s.
        q_d: (6,), which becomes the memory of the next tick.
        velocity: (6,), which becomes the command in rad/s.
        correction: (6,), which becomes the correction.

    Returns:
        The squared step of the joints on the path in rad^2.
    """
    J = nominal[1]
    rates = follow_path(X_WD, V_WD, nominal[0], J)
    step = 0.0
    for i in range(6):
        step += rates[i, 0] ** 2
    if closeness(J) > 0.0:
        rates = bounded_path(X_WD, V_WD, nominal[0], J)
    for i in range(6):
        velocity[i] = rates[i, 1]
        q_d[i] = memory[i] + rates[i, 0] + period * rates[i, 1]
    error(reached[0], X_WD, correction)
    if not is_seen:
        return step
    twist = euler_feedback(wanted, seen, gains)
    limit_twist(twist, correction, limits[0], limits[1])
    if closeness(reached[1]) > 0.0:
        added = bounded_rates(reached[1], twist, gains[1] * (memory - position))
    else:
        added = robust_solve(reached[1], twist.reshape(6, 1))[:, 0].copy()
    share = min(1.0, limits[2] / max(np.max(np.abs(added)), 1e-12))
    for i in range(6):
        velocity[i] += share * added[i]
    return step


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
    pbvs(X, V, X, X, True, *places[:2], V, V, (1.0, 1.0), (1.0, 1.0, 1.0), 1.0, V.copy(), V.copy(), V.copy())
    found = X.copy(), V.copy(), V.copy(), V.copy()
    corrected_pose(X, V, X, X, True, np.zeros(24), (1.0, 1.0), (1.0, 1.0), 1.0, *found)
