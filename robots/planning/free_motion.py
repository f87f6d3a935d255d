"""Where the joints go from one position to another if the way does not matter: the quickest, through regions.

Each joint is a spline of degree 7 over the duration, Reiner (2010), 5.3.1, and all of them are
optimised together for a rigid arm, whose inertia depends on the way. The way alone, q(s), is handed on;
how fast an elastic arm can go along it is the matter of `robots.planning.optimum`.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import ruckig
from numpy.polynomial import chebyshev
from scipy.interpolate import BSpline

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.friction_line import friction_line
from robots.planning.arm_expression import ArmExpression
from robots.planning.joint_path import Curve, PathError, interpolated, nodes
from robots.planning.limits import MotionLimits
from robots.planning.spline_program import PointProgram, solve
from robots.planning.time_spline import AT_REST, DEGREE, bases, knots, points, weights

COEFFICIENTS = 28  # of each joint's spline
ITERATIONS = 60  # of IPOPT, at most
_ORDERS = 4  # position and three derivatives
_FREE = (0, 1, 2)  # joints that may depart from the straight way; others only if they move at all
_SMOOTH = 3e-6  # weight of the third derivative by the share of the duration
_BLUNT = 15.0  # times the width of the friction's sign change
_ROOM = 0.97  # of the limits: an elastic arm needs a little more
_PATH_DEGREE = 14  # of the polynomial that the way becomes
_SAMPLES = 240
_SLOWER = 1.3  # than the jerk-limited profile that the optimiser begins with
_JERK = 20.0  # of this, in accelerations per second
_SLOWEST = 4.0  # times that
_TURN = 2.0 * np.pi  # rad: no coefficient is larger
_REST = COEFFICIENTS - AT_REST


@dataclass(frozen=True)
class ViaRegion:
    """Where the joints pass in between: within so much of a position, all at a time that is found.

    Attributes:
        q: rad, shape (6,).
        within: rad, of each joint.
    """

    q: np.ndarray
    within: float


@dataclass(frozen=True)
class FreeWay:
    """What the optimiser found."""

    path: Curve
    duration: float  # s, of a rigid arm
    iterations: int
    status: str  # of IPOPT


def free_way(
    robot: RobotModel,
    payload: float,
    start: np.ndarray,
    goal: np.ndarray,
    limits: MotionLimits,
    via: tuple[ViaRegion, ...] = (),
) -> FreeWay:
    """The way of the quickest motion of a rigid arm from rest to rest.

    Args:
        robot: as the planner knows it.
        payload: mass at the flange in kg.
        start: joint positions in rad, shape (6,).
        goal: likewise.
        limits: of joints, motors and gears; those of the tool do not count here.
        via: regions, in the order in which they are passed.

    Raises:
        PathError: if nothing moves, or the optimiser finds no motion.
    """
    stops = np.array([start, *(each.q for each in via), goal])
    lengths = np.abs(np.diff(stops, axis=0)).max(axis=1)
    if not lengths.max() > 0.0:
        raise PathError("the motion ends where it starts: no joint moves")
    moving = [i for i in range(NUM_JOINTS) if i in _FREE or np.ptp(stops[:, i]) > 0.0]
    shares = np.append(0.0, np.cumsum(lengths) / lengths.sum())
    unit, profile = _profile(float(lengths.sum()), limits)
    sketch = np.array([np.interp(profile, shares, stops[:, i]) for i in moving]).T
    held = np.zeros((COEFFICIENTS, len(moving)))
    held[:AT_REST], held[_REST:] = start[moving], goal[moving]
    times = np.linspace(0.0, 1.0, len(profile))
    basis = BSpline(knots(COEFFICIENTS), np.eye(COEFFICIENTS), DEGREE)(times)
    first = np.linalg.lstsq(basis[:, AT_REST:_REST], sketch - basis @ held, rcond=None)[0]
    size = first.size
    matrix, offset = _splines(held)
    passing = np.interp(shares[1:-1], profile, times)
    found = solve(
        _program(robot, payload, limits, start, moving, unit),
        ca.sparsify(ca.DM(matrix.reshape(-1, size + 1))),
        offset.ravel(),
        weights(COEFFICIENTS),
        np.append(first.T.ravel(), 1.0),
        (np.append(np.full(size, -_TURN), 0.05), np.append(np.full(size, _TURN), _SLOWEST)),
        ITERATIONS,
        linear=_regions(via, passing, moving, held) if via else None,
    )
    if "Infeasible" in found.status:
        raise PathError("the limits admit no motion from pose to pose, whatever the way")
    coefficients = held.copy()
    coefficients[AT_REST:_REST] = found.x[:-1].reshape(len(moving), -1).T
    path = _way(coefficients, start, goal, moving)
    return FreeWay(path, float(found.x[-1]) * unit, found.iterations, found.status)


def _profile(length: float, limits: MotionLimits) -> tuple[float, np.ndarray]:
    """A jerk-limited profile over so many rad: its duration in s, slowed, and shares of the way over time."""
    wanted = ruckig.InputParameter(1)
    wanted.current_position, wanted.target_position = [0.0], [1.0]
    speed, acceleration = (
        float(each[list(_FREE)].min()) / length for each in (limits.speed, limits.acceleration)
    )
    wanted.max_velocity, wanted.max_acceleration = [speed], [acceleration]
    wanted.max_jerk = [_JERK * acceleration]
    trajectory = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(wanted, trajectory)
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    return _SLOWER * trajectory.duration, np.array([trajectory.at_time(t)[0][0] for t in times])


def _splines(held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is linear in the coefficients of all joints and the duration: y of all points, see `_program`."""
    joints, count, inner = held.shape[1], len(points(COEFFICIENTS)), _REST - AT_REST
    matrix = np.zeros((count, _ORDERS * joints + 1, inner * joints + 1))
    offset = np.zeros((count, _ORDERS * joints + 1))
    for order, basis in enumerate(bases(COEFFICIENTS)[:_ORDERS]):
        for j in range(joints):
            matrix[:, order * joints + j, j * inner : (j + 1) * inner] = basis[:, AT_REST:_REST]
        offset[:, order * joints : (order + 1) * joints] = basis @ held
    matrix[:, -1, -1] = 1.0
    return matrix, offset


def _regions(
    via: tuple[ViaRegion, ...], passing: np.ndarray, moving: list[int], held: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Limits of the joints at shares of the duration."""
    basis = BSpline(knots(COEFFICIENTS), np.eye(COEFFICIENTS), DEGREE)(passing)
    rows, lower, upper = [], [], []
    for each, row in zip(via, basis, strict=True):
        known = row @ held
        rows.append(
            np.column_stack([np.kron(np.eye(len(moving)), row[AT_REST:_REST]), np.zeros(len(moving))])
        )
        lower.append(each.q[moving] - each.within - known)
        upper.append(each.q[moving] + each.within - known)
    return np.concatenate(rows), np.concatenate(lower), np.concatenate(upper)


def _program(
    robot: RobotModel,
    payload: float,
    limits: MotionLimits,
    start: np.ndarray,
    moving: list[int],
    unit: float,
) -> PointProgram:
    """y of a point: joints and three derivatives by the share of the duration, then the duration in units."""
    joints, count = len(moving), NUM_JOINTS
    y, w, z = ca.SX.sym("y", _ORDERS * joints + 1), ca.SX.sym("w"), ca.SX.sym("z", 0)
    T = y[_ORDERS * joints]
    rates = [ca.SX(ca.DM(start))] + [ca.SX.zeros(count) for _ in range(_ORDERS - 1)]
    for order in range(_ORDERS):
        for j, joint in enumerate(moving):
            rates[order][joint] = y[order * joints + j] / (T * unit) ** order
    symbols = [ca.SX.sym(f"q{order}", count) for order in range(_ORDERS)]
    load = ArmExpression(robot, payload).load(*symbols[:3])
    rate = ca.jtimes(load, ca.vertcat(*symbols[:3]), ca.vertcat(*symbols[1:]))
    of_rates = ca.Function("load", symbols, [load, rate])
    gear, gear_rate = of_rates(*rates)
    q, speed, acceleration, jerk = rates
    coulomb, viscous = friction_line(robot)
    friction = viscous * speed + coulomb * ca.tanh(speed / (_BLUNT * robot.coulomb_velocity))
    motor = robot.reflected_inertia * acceleration + friction + gear
    rows, middle = [], 0.5 * (robot.lower + robot.upper)
    for values, most, which in (
        ((q - middle), 0.5 * (robot.upper - robot.lower) / _ROOM, moving),
        (speed, limits.speed, moving),
        (acceleration, limits.acceleration, moving),
        (jerk, limits.jerk, moving),
        (motor, limits.motor_torque, range(count)),
        (gear, limits.gear_torque, range(count)),
        (gear_rate, limits.gear_torque_rate, range(count)),
    ):
        rows += [values[i] / float(_ROOM * most[i]) for i in which if np.isfinite(most[i])]
    lasting = [int(i) for i in np.flatnonzero(np.isfinite(limits.continuous_torque))]
    means = [(motor[i] / float(limits.continuous_torque[i])) ** 2 for i in lasting]
    smooth = _SMOOTH * w * ca.sumsqr(y[3 * joints : 4 * joints])
    return PointProgram(
        ca.Function("bounded", [y, z], [ca.vertcat(*rows)]),
        -np.ones(len(rows)),
        np.ones(len(rows)),
        ca.Function("means", [y, z], [ca.vertcat(*means)]),
        ca.Function("cost", [y, w, z], [w * T + smooth]),
    )


def _way(coefficients: np.ndarray, start: np.ndarray, goal: np.ndarray, moving: list[int]) -> Curve:
    """q(s) over the share of the way that the joints have made together, as a polynomial with these ends."""
    x = np.linspace(0.0, 1.0, _SAMPLES)
    basis = BSpline(knots(COEFFICIENTS), np.eye(COEFFICIENTS), DEGREE)
    q = np.tile(start, (_SAMPLES, 1))
    q[:, moving] = basis(x) @ coefficients
    made = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1)))
    s = made / made[-1]
    # The ends, where many times fall on one place, count no more than the middle.
    even = np.linspace(0.0, 1.0, _SAMPLES)
    straight = start + even[:, None] * (goal - start)
    bend = np.array([np.interp(even, s, q[:, i]) for i in range(NUM_JOINTS)]).T - straight
    shapes = (even * (1.0 - even))[:, None] * chebyshev.chebvander(2.0 * even - 1.0, _PATH_DEGREE - 2)
    amounts = np.linalg.lstsq(shapes, bend, rcond=None)[0]
    u = nodes(_PATH_DEGREE)
    at_nodes = (u * (1.0 - u))[:, None] * chebyshev.chebvander(2.0 * u - 1.0, _PATH_DEGREE - 2) @ amounts
    return interpolated(start + u[:, None] * (goal - start) + at_nodes)
