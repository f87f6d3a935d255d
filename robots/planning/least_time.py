"""A time that no motion between two positions can beat, whatever way the joints go.

Gravity has no moment about an upright axis 1, so the arm's angular momentum L about it changes by the torque
of gear 1 alone, whatever the other joints do. They can make the arm's inertia smaller, as far as they get in
the time, and lend it some of their own momentum:

    I(q) q1' + sum of m_j(q) q_j' = L,   L' = gear torque
    motor torque = rotor's inertia q1'' + friction + gear torque

With the least and largest I and the largest m_j within reach of both ends this is a linear program, whose
largest angle is compared with the one that axis 1 has to turn; it never turns back. Every other joint is
bounded by its speed, its acceleration and its rotor, which motor and gear turn together at best. Gears and
links count as rigid, and what the other joints do for axis 1 as free: most motions are far from the bound.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from scipy.optimize import linprog
from scipy.sparse import csr_array

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.friction_line import friction_line
from robots.dynamics.plant import add_robot
from robots.planning.limits import MotionLimits

_INTERVALS = 100  # of the linear program
_ACCURATE = 1e-3  # of the time
_SLICES = 16  # of the time: what is within reach is that at the end of one
_PER_JOINT = (5, 5, 3, 5, 3)  # positions of joints 2 to 6 that are looked at, ends of their reach among them
_UPRIGHT = 1e-6


@dataclass(frozen=True)
class _Reach:
    """What the other joints can do for axis 1 some time away from a rest, in equal steps of time."""

    step: float  # s
    least: np.ndarray  # (k,) kg m^2, inertia about axis 1
    most: np.ndarray  # (k,) likewise
    lent: np.ndarray  # (k,) N m s, the largest momentum of the other joints about it

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """At times in s, shape (n,), rounded up to a step: the three of them, (n,) each."""
        i = np.clip(np.ceil(t / self.step - 1e-9).astype(int), 0, len(self.least) - 1)
        return self.least[i], self.most[i], self.lent[i]


def least_time(
    robot: RobotModel, payload: float, start: np.ndarray, goal: np.ndarray, limits: MotionLimits
) -> float:
    """A lower bound in s of the time of all motions of a rigid arm from rest to rest.

    Args:
        robot: that moves.
        payload: mass at the flange in kg.
        start: joint positions in rad, shape (6,).
        goal: likewise.
        limits: of speed, acceleration, jerk, torques and their rates; mean torques and the tool do not count.
    """
    way, most = np.abs(goal - start), _most_acceleration(robot, limits)
    alone = shortest(way, limits.speed, most)
    upright = abs(robot.base.pose().rotation().matrix()[2] @ _axis_1(robot)) > 1.0 - _UPRIGHT
    if way[0] == 0.0 or not upright:
        return float(alone.max())
    low, high = float(alone[0]), 2.0 * float(alone[0])
    while True:
        reaches = [_reach(robot, payload, q, limits.speed, most, 0.5 * high) for q in (start, goal)]
        if _farthest(robot, limits, reaches, high) >= way[0]:
            break
        low, high = high, 2.0 * high
    while high > (1.0 + _ACCURATE) * low:
        middle = 0.5 * (low + high)
        if _farthest(robot, limits, reaches, middle) >= way[0]:
            high = middle
        else:
            low = middle
    return max(float(alone.max()), low)


def shortest(way: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """The shortest times in s from rest to rest with a largest speed and acceleration, in closed form."""
    with np.errstate(invalid="ignore", divide="ignore"):  # what does not move may be as quick as it likes
        has_cruise = way * acceleration > speed**2
        return np.where(has_cruise, way / speed + speed / acceleration, 2.0 * np.sqrt(way / acceleration))


def _axis_1(robot: RobotModel) -> np.ndarray:
    return robot.joints[0].placement.pose().rotation().matrix() @ robot.axes[0]


def _most_acceleration(robot: RobotModel, limits: MotionLimits) -> np.ndarray:
    """Of each joint in rad/s^2, (6,): its limit, or what motor, gear and friction together give the rotor."""
    coulomb, viscous = friction_line(robot)
    friction = viscous * limits.speed + coulomb
    return np.minimum(
        limits.acceleration,
        (limits.motor_torque + limits.gear_torque + friction) / robot.reflected_inertia,
    )


def _reach(
    robot: RobotModel, payload: float, q: np.ndarray, speed: np.ndarray, most: np.ndarray, span: float
) -> _Reach:
    """Within so many s of a rest at q: positions and speeds that are bounded by speeds and accelerations."""
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "rigid", payload)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    order = [joint.velocity_start() for joint in parts.motors]
    rows = []
    shares = list(product(*(np.linspace(-1.0, 1.0, count) for count in _PER_JOINT)))
    times = np.linspace(0.0, span, _SLICES + 1)
    for t in times:
        rates = np.minimum(speed, most * t) if t > 0.0 else np.zeros(NUM_JOINTS)
        away = rates * (t - 0.5 * rates / most)  # speeds up, then goes on
        least, largest, lent = np.inf, 0.0, 0.0
        for share in shares if t > 0.0 else shares[:1]:
            at = np.clip(q + np.append(0.0, share) * away, robot.lower, robot.upper)
            plant.SetPositions(context, at)
            row = plant.CalcMassMatrix(context)[order[0], order]
            of_arm = row[0] - robot.reflected_inertia[0]
            least, largest = min(least, of_arm), max(largest, of_arm)
            lent = max(lent, float(np.abs(row[1:]) @ rates[1:]))
        rows.append((least, largest, lent))
    low, high, lent = np.array(rows).T
    return _Reach(
        span / _SLICES, np.minimum.accumulate(low), np.maximum.accumulate(high), np.maximum.accumulate(lent)
    )


def _farthest(robot: RobotModel, limits: MotionLimits, reaches: list[_Reach], duration: float) -> float:
    """The largest angle in rad by which axis 1 turns in the time, by a linear program.

    Variables are speed, gear torque and momentum at n + 1 equal times.
    """
    n = _INTERVALS
    h = duration / n
    t = h * np.arange(n + 1)
    of_start, of_goal = reaches[0].at(t), reaches[1].at(t[::-1])
    least = np.maximum(of_start[0], of_goal[0])
    largest, lent = (np.minimum(*each) for each in zip(of_start[1:], of_goal[1:], strict=True))
    one = np.eye(n + 1)
    step, second, mean = np.diff(one, axis=0) / h, np.diff(one, 2, axis=0) / h**2, 0.5 * (one[1:] + one[:-1])
    coulomb, viscous = (each[0] for each in friction_line(robot))
    rotor = robot.reflected_inertia[0] * step + viscous * mean
    motor = limits.motor_torque[0]
    # Rows for the variables, and what they may be at most. Coulomb friction brakes but never hinders.
    rows = [
        (np.diag(least), 0.0 * one, -one, lent),
        (np.diag(-largest), 0.0 * one, one, lent),
        (rotor, mean, 0.0 * mean, np.full(n, motor)),
        (-rotor, -mean, 0.0 * mean, np.full(n, motor + coulomb)),
    ]
    for sign in (1.0, -1.0):
        rows += [
            (sign * step, 0.0 * step, 0.0 * step, np.full(n, limits.acceleration[0])),
            (sign * second, 0.0 * second, 0.0 * second, np.full(n - 1, limits.jerk[0])),
            (0.0 * step, sign * step, 0.0 * step, np.full(n, limits.gear_torque_rate[0])),
        ]
    known = [each for each in rows if np.isfinite(each[3]).all()]
    speed, torque = limits.speed[0], limits.gear_torque[0]
    bounds = np.repeat([(0.0, speed), (-torque, torque), (-np.inf, np.inf)], n + 1, axis=0)
    bounds[[i * (n + 1) + end for i in range(3) for end in (0, n)]] = 0.0  # at rest
    found = linprog(
        -np.append(h * mean.sum(axis=0), np.zeros(2 * (n + 1))),
        csr_array(np.vstack([np.hstack(each[:3]) for each in known])),
        np.concatenate([each[3] for each in known]),
        csr_array(np.hstack([0.0 * mean, -mean, step])),
        np.zeros(n),
        bounds,
    )
    if not found.success:
        raise RuntimeError(f"the bound of the time was not found: {found.message}")
    return -float(found.fun)
