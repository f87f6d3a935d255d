"""The quickest or most frugal motion along a path within all limits: a spline s(t), found by IPOPT."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from robots.description.model import NUM_JOINTS
from robots.planning.joint_path import PathError
from robots.planning.limit_use import energy
from robots.planning.limits import OVER_TIME, MotionLimits
from robots.planning.path_dynamics import ORDERS, PathDynamics
from robots.planning.ringing import Band, ringing_rows
from robots.planning.spline_program import SOLVED, PointProgram, Solution, solve
from robots.planning.time_spline import AT_REST, TimeSpline, at_rest, bases, points, weights

OBJECTIVES = ("time", "energy")
ITERATIONS = 60  # of IPOPT, at most
# Weight of the fourth derivative: without it limits are used in ways that a drive of 4 ms cannot follow.
_SMOOTH = {"time": 5e-8, "energy": 1e-8, "calm": 1e-9}
_LONG = 0.8  # s, from which on a motion is long: its ends are a smaller share of it
_ROUNDED = 0.03  # of the mean power at the start, below which the magnitude of a power is rounded
_SLOWEST = 2.5  # times the duration of the start: beyond that the optimiser is lost
_NEAR = 0.45  # use of a limit at the start, from which on the optimiser looks at it
_MISSED = 1.002  # use of a limit that it did not look at, for which it looks again
_ROUNDS = 3


@dataclass(frozen=True)
class Optimum:
    """What the optimiser found."""

    motion: TimeSpline
    iterations: int
    status: str  # of IPOPT

    @property
    def is_solved(self) -> bool:
        """Whether the optimiser has converged."""
        return self.status in SOLVED


@dataclass(frozen=True)
class _Aim:
    """What a motion is optimised for.

    Attributes:
        objective: of `OBJECTIVES`, or ``calm``.
        recuperation: whether braking gives energy back.
        duration: s, or None if it is free.
        smoother: times the weight that keeps the motion smooth.
        band: frequencies in Hz at which a motion shall have little; it needs a duration.
        calm: twice what it costs to have as much there as the start.
    """

    objective: str
    recuperation: bool
    duration: float | None
    smoother: float = 1.0
    band: Band | None = None
    calm: float = 1.0


def optimum(
    dynamics: PathDynamics,
    limits: MotionLimits,
    start: TimeSpline,
    objective: str = "time",
    recuperation: bool = False,
    duration: float | None = None,
    smoother: float = 1.0,
) -> Optimum:
    """Optimises a motion.

    Args:
        dynamics: robot and path.
        limits: that are kept at some points of every interval of the spline.
        start: a motion to begin with; it need not keep them.
        objective: of `OBJECTIVES`; energy needs a duration.
        recuperation: whether braking gives energy back.
        duration: s, of the motion; None if it is free.
        smoother: times the weight that keeps the motion smooth, where the optimiser does not converge.

    Raises:
        ValueError: if there is no such objective, or energy has no duration.
        PathError: if the limits admit no motion.
    """
    if objective not in OBJECTIVES:
        raise ValueError(f"--objective must be one of {', '.join(OBJECTIVES)}, got '{objective}'")
    if objective == "energy" and duration is None:
        raise ValueError("planning: the least energy needs a duration, or the motion would take forever")
    return _found(dynamics, limits, start, _Aim(objective, recuperation, duration, smoother))


def calmed(
    dynamics: PathDynamics,
    limits: MotionLimits,
    found: Optimum,
    band: Band,
    slower: float = 0.0,
    energy_weight: float | None = None,
    recuperation: bool = False,
    begin: TimeSpline | None = None,
) -> Optimum:
    """The motion that makes the arm ring least, where a quickest or most frugal one gives a little away.

    Args:
        dynamics: robot and path.
        limits: that are kept.
        found: the quickest or most frugal motion within them.
        band: frequencies at which the arm rings, see `ringing_band`.
        slower: share of its duration that is added.
        energy_weight: of twice its energy: what it costs to ring like it; None where energy does not count.
        recuperation: whether braking gives energy back.
        begin: a motion near to what is looked for; None for the one that was found.

    Raises:
        PathError: if the limits admit no such motion.
    """
    start = TimeSpline(found.motion.coefficients, (1.0 + slower) * found.motion.duration)
    objective = "calm" if energy_weight is None else "energy"
    weight = 1.0 if energy_weight is None else energy_weight
    aim = _Aim(objective, recuperation, start.duration, band=band, calm=weight)
    calm = _found(dynamics, limits, start, aim, begin)
    return replace(calm, iterations=max(found.iterations, calm.iterations))


def _found(
    dynamics: PathDynamics,
    limits: MotionLimits,
    start: TimeSpline,
    aim: _Aim,
    begin: TimeSpline | None = None,
) -> Optimum:
    """What is best, in units of the start; the optimiser begins there if nothing else is given."""
    iterations = 0
    rows = _used(dynamics, limits, start) > _NEAR
    motion = begin or start
    for _ in range(_ROUNDS):
        found, motion = _solved(dynamics, limits, start, motion, rows, aim)
        iterations += found.iterations
        if "Infeasible" in found.status:
            break
        used = _used(dynamics, limits, motion)
        if not (used[~rows] > _MISSED).any():
            return Optimum(motion, iterations, found.status)
        rows = rows | (used > _NEAR)
    raise PathError("the limits admit no motion of this duration along the path")


def _scales(limits: MotionLimits) -> np.ndarray:
    """What is one in each row of `PathDynamics.near`."""
    of_tool = np.square([limits.tool_speed, limits.tool_acceleration])
    return np.concatenate([*(getattr(limits, name) for name in OVER_TIME), of_tool])


def _used(dynamics: PathDynamics, limits: MotionLimits, motion: TimeSpline) -> np.ndarray:
    """The largest share of each row of `PathDynamics.near`."""
    rates = motion.rates(points(len(motion.coefficients)) * motion.duration)
    used = np.abs(dynamics.rows(rates)) / _shares(limits, len(motion.coefficients)).T
    return used.max(axis=1) / _scales(limits)


def _shares(limits: MotionLimits, count: int) -> np.ndarray:
    """What may be used of `_scales` at the points of a spline with so many coefficients, (points, rows)."""
    of_joints = limits.shares_at(points(count))
    return np.column_stack([of_joints.reshape(len(of_joints), -1), np.ones((len(of_joints), 2))])


def _solved(
    dynamics: PathDynamics,
    limits: MotionLimits,
    start: TimeSpline,
    begin: TimeSpline,
    rows: np.ndarray,
    aim: _Aim,
) -> tuple[Solution, TimeSpline]:
    count, unit, duration = len(start.coefficients), start.duration, aim.duration
    free = slice(AT_REST, count - AT_REST)
    splines, x, held = bases(count), points(count), at_rest(count)
    # y of a point: s and four derivatives by the share of the duration, then the duration over that at first.
    matrix = np.zeros((len(x), ORDERS + 1, count - 2 * AT_REST + 1))
    matrix[:, :ORDERS, :-1] = np.stack([basis[:, free] for basis in splines], axis=1)
    matrix[:, ORDERS, -1] = 1.0
    offset = np.zeros((len(x), ORDERS + 1))
    offset[:, :ORDERS] = np.stack([basis @ held for basis in splines], axis=1)
    first = 1.0 if duration is None else duration / unit
    low, high = (0.02, _SLOWEST) if duration is None else (first, first)
    inside = np.ones(count - 2 * AT_REST)
    squares = None
    if aim.band is not None:
        assert duration is not None
        A = ringing_rows(count, duration, aim.band)
        A *= np.sqrt(aim.calm) / np.linalg.norm(A @ start.coefficients)  # the cost of the start is calm / 2
        squares = np.column_stack([A[:, free], np.zeros(len(A))]), A @ held
    found = solve(
        _program(dynamics, limits, start, rows, aim),
        ca.sparsify(ca.DM(matrix.reshape(-1, matrix.shape[-1]))),
        offset.ravel(),
        weights(count),
        np.append(begin.coefficients[free], begin.duration / unit if duration is None else first),
        (np.append(-0.5 * inside, low), np.append(1.5 * inside, high)),
        ITERATIONS,
        squares,
    )
    coefficients = held.copy()
    coefficients[free] = found.x[:-1]
    return found, TimeSpline(coefficients, float(found.x[-1]) * unit)


def _program(
    dynamics: PathDynamics,
    limits: MotionLimits,
    start: TimeSpline,
    rows: np.ndarray,
    aim: _Aim,
) -> PointProgram:
    objective, smoother, unit = aim.objective, aim.smoother, start.duration
    y, w, z = ca.SX.sym("y", ORDERS + 1), ca.SX.sym("w"), ca.SX.sym("z", dynamics.places.size1_out(0))
    T = y[ORDERS]
    rates = ca.vertcat(*[y[d] / (T * unit) ** d for d in range(ORDERS)])
    values = dynamics.near(rates, z)
    scales, chosen = _scales(limits), [int(row) for row in np.flatnonzero(rows)]
    bounded = [values[row] / scales[row] for row in chosen] + [y[1]]  # never backwards
    shares = _shares(limits, len(start.coefficients))[:, chosen]
    speed, torque = values[:NUM_JOINTS], values[3 * NUM_JOINTS : 4 * NUM_JOINTS]
    lasting = [int(joint) for joint in np.flatnonzero(np.isfinite(limits.continuous_torque))]
    means = [(torque[joint] / float(limits.continuous_torque[joint])) ** 2 for joint in lasting]
    # Ends as sharp as those of a short motion: what the share of a duration weighs goes with its sixth power.
    smooth = smoother * _SMOOTH[objective] * min(1.0, (_LONG / unit) ** 6) * w * y[ORDERS - 1] ** 2
    cost = w * T + smooth if objective == "time" else smooth
    if objective == "energy":
        times = points(len(start.coefficients)) * unit
        of_start = energy(dynamics.demand(start.rates(times)), times)
        power = torque * speed
        if not aim.recuperation:
            power = ca.sqrt(power**2 + (_ROUNDED * of_start / unit) ** 2)
        cost = w * ca.sum1(power) * T * unit / of_start + smooth
    return PointProgram(
        ca.Function("bounded", [y, z], [ca.vertcat(*bounded)]),
        np.column_stack([np.where(np.array(chosen) < 6 * NUM_JOINTS, -shares, -0.1), np.zeros(len(shares))]),
        np.column_stack([shares, np.full(len(shares), np.inf)]),
        ca.Function("means", [y, z], [ca.vertcat(*means)]),
        ca.Function("cost", [y, w, z], [cost]),
        dynamics.places,
    )
