"""What a motion along a path asks of motors and gears, as a function of the path's parameter and its rates.

Along a path q(s) the load of the gears is tau = g(s) + a(s) s'' + b(s) s'^2, and so is all that yields to it:
the deflections of the gears, of bearings and beams, and the turns of the motors that make up for them, which
is the approximate inverse model of Reiner (2010), section 3.8.1. Every coefficient becomes a polynomial of s;
derivatives by time follow from it by the chain rule, and casadi differentiates it for the optimiser.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.friction_line import friction_line
from robots.dynamics.plant import PlantRobot, add_robot
from robots.planning.joint_path import HIGHEST, Curve, smooth_curve

# What the planner knows to yield, and what of the plant that is.
DYNAMICS = {"rigid": "rigid", "flexible_joint": "joints", "elastic_structure": "structure"}
ORDERS = 5  # s and four derivatives
_OF_LOADS, _OF_PATH = 2, 3  # derivatives by s that a demand contains
_BY_OPTIMISER = 2  # more of them that an optimiser takes
_DAMPING = 0.05  # of the turns that make up for the structure, where the arm is nearly singular
_ROTATION = 0.12  # what a radian weighs beside the reach, as in the feedforward
_SCALE = np.append(np.tile(np.repeat([1e3, 1e-3], 6), 3), np.ones(3))  # N m, rad; m
_ACCURATE = 1e-5  # of that
_BLUNT = 15.0  # times the width of the friction's sign change, which an optimiser would not resolve


@dataclass(frozen=True)
class Demand:
    """What a motion asks for, at n times."""

    speed: np.ndarray  # (n, 6) rad/s, of the motors seen behind the gear
    acceleration: np.ndarray  # (n, 6) rad/s^2, of the links
    jerk: np.ndarray  # (n, 6) rad/s^3, of the links
    motor_torque: np.ndarray  # (n, 6) N m, joint side
    gear_torque: np.ndarray  # (n, 6) N m
    gear_torque_rate: np.ndarray  # (n, 6) N m/s
    tool_speed: np.ndarray  # (n,) m/s
    tool_acceleration: np.ndarray  # (n,) m/s^2

    @property
    def power(self) -> np.ndarray:
        """Of all motors together without recuperation, in W: what they give and what they brake, (n,)."""
        return np.abs(self.motor_torque * self.speed).sum(axis=1)

    @property
    def net_power(self) -> np.ndarray:
        """The same with recuperation: braking counts against driving."""
        return (self.motor_torque * self.speed).sum(axis=1)


class PathDynamics:
    """A robot on a path; `demand` for numbers, `expression` for an optimiser.

    Attributes:
        path: q(s) in rad.
        places: casadi's, of s: values of the polynomials and of their derivatives at a place of the path.
        near: casadi's, of (s less that of the place, s', s'', s''', s'''') and ``places``: speed,
            acceleration, jerk, motor torque, gear torque and its rate (6 each), then speed and acceleration
            of the tool, squared. At the place it and its first two derivatives are exact.
    """

    def __init__(
        self, robot: RobotModel, payload: float, path: Curve, dynamics: str, highest: int = HIGHEST
    ) -> None:
        """Takes the coefficients from inverse dynamics along the path.

        Args:
            robot: the robot as the controller knows it.
            payload: mass at the flange in kg.
            path: q(s) in rad, shape (6,).
            dynamics: of `DYNAMICS`.
            highest: degree of the polynomials that the coefficients may need.

        Raises:
            ValueError: if there are no such dynamics, or the robot may not carry the payload.
            PathError: if the path is singular; with the place.
        """
        if dynamics not in DYNAMICS:
            raise ValueError(f"--dynamics must be one of {', '.join(DYNAMICS)}, got '{dynamics}'")
        self.path = path
        self._robot = robot
        arm = _Arm(robot, payload, dynamics)
        self._curve = smooth_curve(
            lambda s: arm.coefficients(path, s), "the load of the gears", _SCALE, _ACCURATE, highest
        )
        self.places, self.near = self._functions()
        s = ca.MX.sym("s", ORDERS)
        self._here = ca.Function("here", [s], [self.near(ca.vertcat(0.0, s[1:]), self.places(s[0]))])
        self._mapped: dict[int, ca.Function] = {}

    def demand(self, rates: np.ndarray) -> Demand:
        """What a motion asks for.

        Args:
            rates: s and its first four derivatives by time, shape (5, n).
        """
        found = self.rows(rates).T
        of_joints = np.split(found[:, : 6 * NUM_JOINTS], 6, axis=1)
        return Demand(*of_joints, *np.sqrt(np.maximum(found[:, 6 * NUM_JOINTS :], 0.0)).T)

    def motors(self, rates: np.ndarray) -> np.ndarray:
        """Where the motors are, seen behind the gear, in rad, at s and its derivatives (5, n); (n, 6)."""
        return self.path.at(rates[0]) + np.array(self._ahead.map(rates.shape[1])(rates)).T

    def torque(self, rates: np.ndarray) -> np.ndarray:
        """Torques of the motors in N m with friction as sharp as it is, at (5, n); shape (n, 6)."""
        demand, robot = self.demand(rates), self._robot
        sharp, blunt = (np.tanh(demand.speed / (factor * robot.coulomb_velocity)) for factor in (1.0, _BLUNT))
        return demand.motor_torque + friction_line(robot)[0] * (sharp - blunt)

    def rows(self, rates: np.ndarray) -> np.ndarray:
        """The values of ``near`` at s and its derivatives (5, n); shape (38, n)."""
        count = rates.shape[1]
        if count not in self._mapped:
            self._mapped[count] = self._here.map(count)
        return np.array(self._mapped[count](rates))

    def _functions(self) -> tuple[ca.Function, ca.Function]:
        # A polynomial that an optimiser differentiates at every point is most of its work. Its values and
        # derivatives at a place are numbers, and a Taylor series of these is as good there.
        s, robot = ca.SX.sym("s", ORDERS), self._robot
        of_curve = [self._curve.derivative(order) for order in range(_OF_LOADS + _BY_OPTIMISER + 1)]
        of_path = [self.path.derivative(order) for order in range(_OF_PATH + _BY_OPTIMISER + 1)]
        places = _values([*of_curve, *of_path])
        z = ca.SX.sym("z", places.size1_out(0))
        ends = np.cumsum([curve.coefficients.shape[1] for curve in (*of_curve, *of_path)])
        parts = ca.vertsplit(z, [0, *(int(end) for end in ends)])

        def rate(expression: ca.SX) -> ca.SX:
            return ca.jtimes(expression, s[: ORDERS - 1], s[1:])

        values = _taylor(parts[: len(of_curve)], s[0])
        g, a, b, tool = ca.vertsplit(values, [0, 12, 24, 36, 39])
        yields = g + a * s[2] + b * s[1] ** 2
        load, ahead = yields[:6], yields[6:]
        q = _taylor(parts[len(of_curve) :], s[0])
        of_place, at = ca.Function("ahead", [s, z], [ahead]), ca.MX.sym("s", ORDERS)
        self._ahead = ca.Function("ahead", [at], [of_place(ca.vertcat(0.0, at[1:]), places(at[0]))])
        velocity = rate(q)
        acceleration = rate(velocity)
        theta_rate = velocity + rate(ahead)
        theta_acceleration = acceleration + rate(rate(ahead))
        coulomb, viscous = friction_line(robot)
        sign = ca.tanh(theta_rate / (_BLUNT * robot.coulomb_velocity))
        friction = viscous * theta_rate + coulomb * sign
        torque = robot.reflected_inertia * theta_acceleration + friction + load
        tool_velocity = rate(tool)
        tool_acceleration = rate(tool_velocity)
        outputs = (
            theta_rate,
            acceleration,
            rate(acceleration),
            torque,
            load,
            rate(load),
            ca.sumsqr(tool_velocity),
            ca.sumsqr(tool_acceleration),
        )
        return places, ca.Function("near", [s, z], [ca.vertcat(*outputs)])


class _Arm:
    """Inverse dynamics of a robot on a path: what is constant, what goes with s'' and with s'^2."""

    def __init__(self, robot: RobotModel, payload: float, dynamics: str) -> None:
        self._plant = MultibodyPlant(0.0)
        self._parts: PlantRobot = add_robot(self._plant, robot, DYNAMICS[dynamics], payload)
        self._plant.Finalize()
        self._context, self._forces = self._plant.CreateDefaultContext(), MultibodyForces(self._plant)
        self._motors = [joint.position_start() for joint in self._parts.motors]
        self._gears = [joint.position_start() for joint in self._parts.deflections]
        self._structure = [joint.position_start() for joint in self._parts.structure]
        self._robot = robot
        reach = float(sum(np.linalg.norm(joint.placement.translation) for joint in robot.joints[1:]))
        self._weights = np.repeat([_ROTATION, 1.0 / reach], 3)

    def coefficients(self, path: Curve, s: np.ndarray) -> np.ndarray:
        """For g, a and b: loads (6), turns of the motors ahead of the links (6), then the tool (3)."""
        rows = []
        for q, dq, ddq in zip(path.at(s), path.at(s, 1), path.at(s, 2), strict=True):
            still = np.zeros(NUM_JOINTS)
            g = self._torques(q, still, still)
            a = self._torques(q, still, dq) - g
            b = self._torques(q, dq, ddq) - g
            # Friction of the motors is not quadratic in speed and stands elsewhere.
            b[self._motors] -= self._robot.joint_viscous_friction * dq
            parts = []
            for torque, acceleration in ((g, still), (a, dq), (b, ddq)):
                load = torque[self._motors] - self._robot.reflected_inertia * acceleration
                parts += [load, self._ahead(q, load, torque)]
            tool = self._parts.tool.CalcPoseInWorld(self._context).translation()
            rows.append(np.concatenate([*parts, tool]))
        return np.array(rows)

    def _torques(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> np.ndarray:
        n = self._plant.num_positions()
        state, acceleration = np.zeros(2 * n), np.zeros(n)
        state[self._motors], acceleration[self._motors] = q, vdot
        state[n:][self._motors] = v
        self._plant.SetPositionsAndVelocities(self._context, state)
        self._plant.CalcForceElementsContribution(self._context, self._forces)
        return self._plant.CalcInverseDynamics(self._context, acceleration, self._forces)

    def _ahead(self, q: np.ndarray, load: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """How far the motors are ahead of the joints of a rigid robot, in rad, (6,)."""
        if not self._gears:
            return np.zeros(NUM_JOINTS)
        ahead = load / self._robot.joint_stiffness
        if self._structure:
            stiffness = self._parts.sprung_stiffness[NUM_JOINTS:]
            world = self._plant.world_frame()
            J = self._plant.CalcJacobianSpatialVelocity(
                self._context, JacobianWrtVariable.kV, self._parts.tool, np.zeros(3), world, world
            )
            J = self._weights[:, None] * J
            lost = J[:, self._structure] @ (torque[self._structure] / stiffness)
            of_joints = J[:, self._motors]
            squared = of_joints @ of_joints.T + _DAMPING**2 * np.eye(6)
            ahead = ahead + of_joints.T @ np.linalg.solve(squared, lost)
        return ahead


def _values(curves: list[Curve]) -> ca.Function:
    """The values of curves, one behind the other, as a function of s: sums of Chebyshev polynomials."""
    most = max(len(curve.coefficients) for curve in curves)
    s, at = ca.SX.sym("s"), ca.MX.sym("s")
    polynomials = [ca.SX(1.0), 2.0 * s - 1.0]
    while len(polynomials) < most:
        polynomials.append(2.0 * polynomials[1] * polynomials[-1] - polynomials[-2])
    all_of_them = ca.Function("polynomials", [s], [ca.vertcat(*polynomials[:most])])
    coefficients = [
        np.pad(curve.coefficients.T, ((0, 0), (0, most - len(curve.coefficients)))) for curve in curves
    ]
    # One product of numbers: as an expression it would be thousands of operations.
    return ca.Function("values", [at], [ca.DM(np.concatenate(coefficients)) @ all_of_them(at)])


def _taylor(derivatives: list[ca.SX], step: ca.SX) -> ca.SX:
    """A value a step away from where these derivatives are."""
    total = derivatives[-1]
    for order in range(len(derivatives) - 1, 0, -1):
        total = derivatives[order - 1] + step / order * total
    return total
