"""Where the joints go from one position to another if the way does not matter: the quickest, through regions.

Each joint is a spline of degree 7 over the duration, Reiner (2010), 5.3.1, and all of them are
optimised together for a rigid arm, whose inertia depends on the way. An elastic arm can be driven over the
same time, with lower limits where it needs more, or along the same way, q(s); how fast it can go along that
is the matter of `robots.planning.optimum`.
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
from robots.planning.limits import OVER_TIME, MotionLimits
from robots.planning.spline_program import SOLVED, PointProgram, solve
from robots.planning.time_spline import AT_REST, DEGREE, bases, knots, points, weights

ITERATIONS = 60  # of IPOPT, at most
_ORDERS = 4  # position and three derivatives
_FREE = (0, 1, 2)  # joints that may depart from the straight way; others only if they move at all
_BLUNT = 15.0  # times the width of the friction's sign change
_PATH_DEGREE = 14  # of the polynomial that the way becomes
_TIME_DEGREE = 66  # of that over the duration, which has to follow the spline
_SAMPLES = 240
_SLOWER = 1.3  # than the jerk-limited profile that the optimiser begins with
_JERK = 20.0  # of this, in accelerations per second
_SLOWEST = 4.0  # times that
_TURN = 2.0 * np.pi  # rad: no coefficient is larger


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
class Sharpness:
    """How far a motion may go to the edge of its limits; by default as far as an elastic arm can follow.

    Attributes:
        count: of each joint's coefficients.
        smooth: weight of the third derivative by the share of the duration.
        room: share of the limits that is used.
    """

    count: int = 28
    smooth: float = 3e-6
    room: float = 0.97


@dataclass(frozen=True)
class FreeMotion:
    """What the optimiser found.

    Attributes:
        coefficients: of the splines over t / duration, rad, shape (n, 6).
        duration: s, of a rigid arm.
        iterations: of IPOPT.
        status: of IPOPT.
    """

    coefficients: np.ndarray
    duration: float
    iterations: int
    status: str

    @property
    def is_solved(self) -> bool:
        """Whether the optimiser has converged."""
        return self.status in SOLVED

    def at(self, x: np.ndarray) -> np.ndarray:
        """Joint positions in rad at shares of the duration (n,), shape (n, 6)."""
        return BSpline(knots(len(self.coefficients)), self.coefficients, DEGREE)(x)

    @property
    def way(self) -> Curve:
        """q(s) over the share of the way that the joints have made together, with the same ends."""
        even = np.linspace(0.0, 1.0, _SAMPLES)
        q = self.at(even)
        made = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1)))
        # The ends, where many times fall on one place, count no more than the middle.
        start, goal = self.coefficients[[0, -1]]
        straight = start + even[:, None] * (goal - start)
        bend = np.array([np.interp(even, made / made[-1], each) for each in q.T]).T - straight
        shapes = (even * (1.0 - even))[:, None] * chebyshev.chebvander(2.0 * even - 1.0, _PATH_DEGREE - 2)
        amounts = np.linalg.lstsq(shapes, bend, rcond=None)[0]
        u = nodes(_PATH_DEGREE)
        at_nodes = (u * (1.0 - u))[:, None] * chebyshev.chebvander(2.0 * u - 1.0, _PATH_DEGREE - 2) @ amounts
        return interpolated(start + u[:, None] * (goal - start) + at_nodes)

    @property
    def over_time(self) -> Curve:
        """q(s) over the share of the duration, with the same ends and five derivatives of rest there."""
        flat = chebyshev.poly2cheb([1.0, 0.0, -1.0])  # 1 - u^2
        step = chebyshev.chebint(chebyshev.chebpow(flat, AT_REST - 1), lbnd=-1.0)
        step /= chebyshev.chebval(1.0, step)
        u = -np.cos(np.linspace(0.0, np.pi, 5 * _SAMPLES))
        start, goal = self.coefficients[[0, -1]]
        rest = self.at(0.5 + 0.5 * u) - start - chebyshev.chebval(u, step)[:, None] * (goal - start)
        window = chebyshev.chebpow(flat, AT_REST)
        shapes = [chebyshev.chebmul(window, each) for each in np.eye(_TIME_DEGREE + 1 - 2 * AT_REST)]
        basis = np.array([np.pad(each, (0, _TIME_DEGREE + 1 - len(each))) for each in shapes]).T
        vandermonde = chebyshev.chebvander(u, _TIME_DEGREE)
        coefficients = basis @ np.linalg.lstsq(vandermonde @ basis, rest, rcond=None)[0]
        coefficients[: len(step)] += step[:, None] * (goal - start)
        coefficients[0] += start
        return Curve(coefficients)


_USUAL = Sharpness()


def free_motion(
    robot: RobotModel,
    payload: float,
    start: np.ndarray,
    goal: np.ndarray,
    limits: MotionLimits,
    via: tuple[ViaRegion, ...] = (),
    sharpness: Sharpness = _USUAL,
    begin: FreeMotion | None = None,
) -> FreeMotion:
    """The quickest motion of a rigid arm from rest to rest.

    Args:
        robot: as the planner knows it.
        payload: mass at the flange in kg.
        start: joint positions in rad, shape (6,).
        goal: likewise.
        limits: of joints, motors and gears; those of the tool do not count here.
        via: regions, in the order in which they are passed.
        sharpness: of the motion.
        begin: a motion near to what is looked for, with as many coefficients; or a jerk-limited profile.

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
    count = sharpness.count
    inner = slice(AT_REST, count - AT_REST)
    held = np.zeros((count, len(moving)))
    held[: inner.start], held[inner.stop :] = start[moving], goal[moving]
    times = np.linspace(0.0, 1.0, len(profile))
    if begin is None:
        sketch = np.array([np.interp(profile, shares, stops[:, i]) for i in moving]).T
        basis = BSpline(knots(count), np.eye(count), DEGREE)(times)
        first = np.linalg.lstsq(basis[:, inner], sketch - basis @ held, rcond=None)[0]
    else:
        first = begin.coefficients[inner, moving]
    size = first.size
    matrix, offset = _splines(held)
    passing = np.interp(shares[1:-1], profile, times)
    found = solve(
        _program(robot, payload, limits, moving, start, unit, sharpness),
        ca.sparsify(ca.DM(matrix.reshape(-1, size + 1))),
        offset.ravel(),
        weights(count),
        np.append(first.T.ravel(), 1.0 if begin is None else begin.duration / unit),
        (np.append(np.full(size, -_TURN), 0.05), np.append(np.full(size, _TURN), _SLOWEST)),
        ITERATIONS,
        linear=_regions(via, passing, moving, held) if via else None,
    )
    if "Infeasible" in found.status:
        raise PathError("the limits admit no motion from pose to pose, whatever the way")
    coefficients = np.tile(start, (count, 1))
    coefficients[inner.stop :] = goal
    coefficients[inner, moving] = found.x[:-1].reshape(len(moving), -1).T
    return FreeMotion(coefficients, float(found.x[-1]) * unit, found.iterations, found.status)


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
    count, joints = held.shape
    size, inner = len(points(count)), count - 2 * AT_REST
    matrix = np.zeros((size, _ORDERS * joints + 1, inner * joints + 1))
    offset = np.zeros((size, _ORDERS * joints + 1))
    for order, basis in enumerate(bases(count)[:_ORDERS]):
        for j in range(joints):
            matrix[:, order * joints + j, j * inner : (j + 1) * inner] = basis[:, AT_REST : count - AT_REST]
        offset[:, order * joints : (order + 1) * joints] = basis @ held
    matrix[:, -1, -1] = 1.0
    return matrix, offset


def _regions(
    via: tuple[ViaRegion, ...], passing: np.ndarray, moving: list[int], held: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Limits of the joints at shares of the duration."""
    count = len(held)
    basis = BSpline(knots(count), np.eye(count), DEGREE)(passing)
    rows, lower, upper = [], [], []
    for each, row in zip(via, basis, strict=True):
        known = row @ held
        rows.append(
            np.column_stack(
                [np.kron(np.eye(len(moving)), row[AT_REST : count - AT_REST]), np.zeros(len(moving))]
            )
        )
        lower.append(each.q[moving] - each.within - known)
        upper.append(each.q[moving] + each.within - known)
    return np.concatenate(rows), np.concatenate(lower), np.concatenate(upper)


def _program(
    robot: RobotModel,
    payload: float,
    limits: MotionLimits,
    moving: list[int],
    start: np.ndarray,
    unit: float,
    sharpness: Sharpness,
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
    middle = 0.5 * (robot.lower + robot.upper)
    rows = [(q[i] - middle[i]) / float(0.5 * (robot.upper[i] - robot.lower[i])) for i in moving]
    x = points(sharpness.count)
    shares = [np.ones((len(x), len(moving)))]
    may_use = limits.shares_at(x)
    values_of = {
        "speed": speed,
        "acceleration": acceleration,
        "jerk": jerk,
        "motor_torque": motor,
        "gear_torque": gear,
        "gear_torque_rate": gear_rate,
    }
    for number, name in enumerate(OVER_TIME):
        most = getattr(limits, name)
        bounded = [i for i in (range(count) if "torque" in name else moving) if np.isfinite(most[i])]
        rows += [values_of[name][i] / float(sharpness.room * most[i]) for i in bounded]
        shares.append(may_use[:, number, bounded])
    within = np.concatenate(shares, axis=1)
    lasting = [int(i) for i in np.flatnonzero(np.isfinite(limits.continuous_torque))]
    means = [(motor[i] / float(limits.continuous_torque[i])) ** 2 for i in lasting]
    roughness = sharpness.smooth * w * ca.sumsqr(y[3 * joints : 4 * joints])
    return PointProgram(
        ca.Function("bounded", [y, z], [ca.vertcat(*rows)]),
        -within,
        within,
        ca.Function("means", [y, z], [ca.vertcat(*means)]),
        ca.Function("cost", [y, w, z], [w * T + roughness]),
    )
