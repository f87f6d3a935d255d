"""Where the tip of an elastic robot is, as a function of all that a controller does not know exactly."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robots.calibration.identifiability import IdentifiableParameters, identifiable_parameters
from robots.configuration.quantity import positive, quantity
from robots.description.error_parameters import NUM_PARAMETERS, TOOL, error_parameters
from robots.description.model import NUM_JOINTS, load_robot
from systems.controller_model import ControllerModel
from systems.estimation import kernels
from systems.estimation.arm_geometry import Arm, ArmGeometry, Constants
from systems.estimation.arm_loads import ArmLoads
from systems.estimation.gears.gear_errors import (
    NUM_MODELS,
    NUM_SHAPES,
    NUM_STATES,
    OPEN,
    SHAPE_NAMES,
    GearErrors,
)
from systems.estimation.kernels.arrays import Seen, SeenOnce, Unknowns
from systems.estimation.learnt_robot import known_before

NO_SHAPES = np.empty((0, 6))
_CHANGED_LOAD = np.array([4.0, 0.3, 0.3, 0.3])  # kg and kg m, of a robot that carries 7 kg
_BASE = 0  # the body whose placement in the world it is
# What no robot of any kind is, nor looks like: beyond it nothing may be commanded by an estimate.
_SHIFT, _ANGLE = 0.15, 0.4  # m and rad, by which a frame may be elsewhere
_SOFTEST = 8.0  # times the compliance that is believed
_HEAVIEST = 21.0  # kg, of a robot that carries 7 kg; at most half a metre from its flange
_CARRIED = 8.75  # kg, the most that is put on such a robot
_LATEST, _FASTEST = 1.0, 1e-2  # s and s/s, by which the camera's clock may be off
_LARGEST_ERROR = 5e-3  # rad, of a gear
_STAYS = 0.02  # of the spread, by which what was measured of a robot may have changed since


@dataclass
class Spread:
    """How far from its belief a robot may be: standard deviations before anything is measured."""

    shift: float = positive(0.012, "m")  # of a frame
    angle: float = positive(0.03, "rad")  # of a joint's zero, an axis or a frame
    calibrated_shift: float = positive(1e-4, "m")  # the same of a calibrated robot whose file does not say
    calibrated_angle: float = positive(2e-4, "rad")
    gear: float = positive(0.3)  # of the compliance of a gear, as a factor
    bearing: float = positive(0.5)  # the same of a bearing
    payload: float = positive(0.5, "kg")  # of a robot that carries 7 kg; of a larger one in proportion
    payload_centre: float = positive(0.015, "m")
    clock: float = positive(5e-3, "s")  # between the stamps of the camera and those of the joints
    clock_drift: float = positive(1e-4, "s/s")  # by which that changes: crystals differ by tens of ppm
    # Of a gear's waves, gap and hysteresis; 5e-5 is a good guess where there are
    gear_error: float = quantity(0.0, 0.0, unit="rad")


class Pair(NamedTuple):
    """One instant: what the encoders said, what the camera saw, and what the plan knows of it."""

    theta: np.ndarray  # (6,) rad
    loads: np.ndarray  # (5, 18) N m, as `ArmLoads.at` gives them
    motion: np.ndarray  # (12,), velocity and acceleration of the joints
    twist: np.ndarray  # (6,), of the tip
    X_WE: np.ndarray  # (4, 4), seen
    unrest: float = 0.0  # m/s^2, of the tip by parameters that are led in
    states: np.ndarray = np.zeros(NUM_STATES)  # of the gears, see `GearErrors`
    others: np.ndarray = np.zeros((NUM_MODELS, NUM_JOINTS))  # rad, see `MotorPlan`
    time: float = 0.0  # s, as the camera's clock has it
    rounding: np.ndarray = np.zeros(NUM_JOINTS)  # rad, standard deviation of theta by steps of the encoders


class Prediction(NamedTuple):
    """The tip in n configurations, and how it moves with the unknowns in units of their spread."""

    X_WE: np.ndarray  # (n, 4, 4)
    H: np.ndarray  # (n, 6, size)
    gears: np.ndarray  # (n, 6), deflection in rad


class TipModel:
    """The unknowns x and what they make of encoder positions and loads.

    The tip is at exp(T phi + V c) F(theta + delta, p), with the gears' deflection delta = -k c_g tau, that of
    the bearings phi = -k c_b M about the axes in the columns T, and the twist V of the tip times the offset
    c = c_0 + c_1 t of the camera's clock. Loads are linear in the payload's mass and first moment.

    The vector of unknowns holds the identifiable geometric errors (m, rad), 18 factors of the compliance of
    gears and bearings, the mass of the payload (kg), the change of its first moment (kg m, 3), the offset of
    the clock (s) and its drift (s/s), and the sizes of the gears' errors (rad, 7 shapes of 6 joints) unless
    their spread is zero.
    """

    def __init__(self, model: ControllerModel, spread: Spread) -> None:
        """Takes means from what is believed and spreads from the configuration."""
        robot = model.robot
        # A calibrated robot has no exactly parallel axes left: what can be seen is known of the drawn one.
        drawn = load_robot(robot.calibration.of) if robot.is_calibrated and robot.calibration.of else robot
        self.identifiable: IdentifiableParameters = identifiable_parameters(drawn)
        chosen = self.chosen = self.identifiable.independent
        self.geometry, self.loads = ArmGeometry(robot, chosen), ArmLoads(robot)
        self.robot, self.parameters = robot, error_parameters(robot)
        g = len(chosen)
        self._no_geometry = np.full(g, np.inf)
        self._gear_error = spread.gear_error
        self.has_gear_errors = spread.gear_error > 0.0
        self.gear_errors = GearErrors(robot)
        self.size = g + 24 + 6 * NUM_SHAPES * self.has_gear_errors
        self.G, self.K = slice(0, g), slice(g, g + 18)
        self.M, self.C, self.D = slice(g + 18, g + 22), g + 22, g + 23
        self.E = slice(g + 24, self.size)
        self.mean, self.sigma = np.zeros(self.size), np.zeros(self.size)
        shift, angle = spread.shift, spread.angle
        if robot.is_calibrated:
            shift, angle = spread.calibrated_shift, spread.calibrated_angle
        self.sigma[self.G] = [shift if self.parameters[i].unit == "m" else angle for i in chosen]
        bearings = [joint.tilting for joint in robot.joints]
        stiffness = [s for t in bearings for s in (t.stiffness if t else (np.inf, np.inf))]
        self.compliance = 1.0 / np.concatenate([robot.joint_stiffness, np.array(stiffness)])
        damping = [d for t in bearings for d in (t.damping if t else (0.0, 0.0))]
        self.lag = np.concatenate([robot.joint_damping, np.array(damping)]) * self.compliance
        self.mean[self.K] = {"rigid": 0.0, "joints": 1.0, "structure": 1.0}[model.elasticity]
        # Bearings of one type differ more than gears do, and few robot files know them.
        self.mean[g + 6 : g + 18] = 0.5 if model.elasticity == "structure" else 0.0
        self.sigma[self.K] = np.concatenate([np.full(6, spread.gear), np.full(12, spread.bearing)])
        self.mean[g + 18] = model.payload
        self.sigma[g + 18] = spread.payload * model.load_scale
        self.sigma[g + 19 : g + 22] = spread.payload_centre * max(model.payload, 0.1)
        self.changed_load = model.load_scale * _CHANGED_LOAD / self.sigma[self.M]  # in units of the spreads
        self.most_carried = max(_CARRIED * model.load_scale, self.mean[g + 18])  # kg
        self.sigma[self.C], self.sigma[self.D] = spread.clock, spread.clock_drift
        if self.has_gear_errors:
            shares = np.ones((NUM_SHAPES, NUM_JOINTS))
            shares[SHAPE_NAMES.index("gap")] = OPEN
            self.sigma[self.E] = spread.gear_error * shares.ravel()
        self._tool, self._world, self._zeros = (self._directions(body) for body in (TOOL, _BASE, None))
        self._least, self._most = self._plausible_range(model.load_scale)
        self.prior = np.eye(self.size)  # information, in units of the spreads
        known = known_before(robot, drawn, chosen) if robot.is_calibrated else None
        if known is not None:
            self._take_over(*known)

    def _take_over(self, covariance: np.ndarray, is_known: np.ndarray) -> None:
        """Makes what a file says of geometry and springs the prior."""
        entries = np.flatnonzero(is_known)
        springs = entries[entries >= self.K.start]
        self.mean[springs] = np.where(self.mean[springs] > 0.0, 1.0, 0.0)
        scaled = covariance[np.ix_(entries, entries)] / np.outer(self.sigma[entries], self.sigma[entries])
        # Nothing is known better than a robot stays as it was.
        P = np.linalg.inv(self.prior)
        P[np.ix_(entries, entries)] = scaled + _STAYS**2 * np.eye(len(entries))
        self.prior = np.linalg.inv(P)

    def _plausible_range(self, load_scale: float) -> tuple[np.ndarray, np.ndarray]:
        """The least and the largest value of each unknown, (n,) each."""
        most = np.empty(self.size)
        most[self.G] = [_SHIFT if self.parameters[i].unit == "m" else _ANGLE for i in self.chosen]
        heaviest = max(_HEAVIEST * load_scale, 3.0 * self.mean[self.M][0])
        most[self.K], most[self.M] = _SOFTEST, heaviest * np.array([1.0, 0.5, 0.5, 0.5])
        most[self.C], most[self.D], most[self.E] = _LATEST, _FASTEST, _LARGEST_ERROR
        return -most, most  # springs and loads make up for what no parameter describes, and may be below zero

    def plausible(self, x: np.ndarray) -> np.ndarray:
        """The unknowns (n,), each within what robots are."""
        return np.minimum(np.maximum(x, self._least), self._most)

    def full(self, xi: np.ndarray) -> np.ndarray:
        """The unknowns in their units from those in units of their spreads, shape (n,) both."""
        return self.mean + self.sigma * xi

    def geometric_errors(self, x: np.ndarray) -> np.ndarray:
        """All error parameters, shape (48,); those that cannot be told from others are zero."""
        p = np.zeros(NUM_PARAMETERS)
        p[self.chosen] = x[self.G]
        return p

    def constants(self, x: np.ndarray) -> Constants:
        """The geometry at a value of the unknowns."""
        return self.geometry.constants(self.geometric_errors(x))

    def constants_near(
        self, x: np.ndarray, x_geometry: np.ndarray, step: float, last: Constants | None
    ) -> Constants:
        """The geometry within a step (m or rad) of x, within which poses are linear in the parameters.

        Args:
            x: the unknowns.
            x_geometry: the value that it was for last; is renewed if x is too far from it.
            step: the largest distance of a parameter.
            last: what the answer was last, which saves time if it is still right.
        """
        of = self._no_geometry if last is None else last.chosen
        is_near = kernels.tip.stay_near(x, x_geometry, step, of)
        return last if last is not None and is_near else self.constants(x_geometry)

    def forward(self, constants: Constants, x: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, Arm]:
        """The tip of an arm that does not yield, near the value that the constants are for.

        Returns:
            Poses (n, 4, 4), and the arm at the constants.
        """
        arm = self.geometry.arm(constants, q)
        step = arm.columns[..., 18:] @ (x[self.G] - constants.p[self.chosen])
        return moved(arm.X_WE, step), arm

    def jacobian(self, constants: Constants, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Of the tip of that arm as its joints q in rad, (6,), move, rotation first, (6, 6)."""
        return self.forward(constants, x, q[None])[1].columns[0, :, :NUM_JOINTS]

    def total_load(self, x: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """Torques of gears and bearings (n, 18) from loads (n, 5, 18)."""
        return np.concatenate(([1.0], x[self.M])) @ loads

    def deflections(self, x: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """How gears and bearings yield in rad, (n, 18), to loads (n, 5, 18)."""
        return -x[self.K] * self.compliance * self.total_load(x, loads)

    def gear_shapes(self, theta: np.ndarray, states: np.ndarray) -> np.ndarray | None:
        """The shapes of gear errors at one configuration, (7, 6); None if there are none.

        Args:
            theta: motor positions in rad, (6,).
            states: of the gears, (18,).
        """
        return self.gear_errors.shapes(theta, states) if self.has_gear_errors else None

    def gear_error(self, x: np.ndarray, shapes: np.ndarray | None) -> np.ndarray | float:
        """What shapes (..., 7, 6) add to the angles of the joints in rad, (..., 6)."""
        if shapes is None:
            return 0.0
        return (shapes * x[self.E].reshape(NUM_SHAPES, 6)).sum(-2)

    def gear_variances(
        self, x: np.ndarray, P: np.ndarray, loads: np.ndarray, states: np.ndarray
    ) -> np.ndarray:
        """What the gears may be off by beyond the uncertainty of x, rad^2, (6,); (0,) without gear errors.

        Args:
            x: the unknowns.
            P: their covariance in units of their spreads.
            loads: of one instant, (5, 18).
            states: of the gears then, (18,).
        """
        if not self.has_gear_errors:
            return np.empty(0)
        sizes, torque = np.empty((2, NUM_SHAPES, NUM_JOINTS)), np.empty((2, NUM_JOINTS))
        kernels.gears.known(x, self.sigma, P, (self.M.start, self.E.start), loads, sizes, torque)
        return self.gear_errors.variances(
            (sizes[0], sizes[1]), states, (torque[0], torque[1]), self._gear_error
        )

    def predict(
        self,
        constants: Constants,
        x: np.ndarray,
        theta: np.ndarray,
        loads: np.ndarray,
        twist: np.ndarray,
        shapes: np.ndarray | None = None,
        time: np.ndarray | float = 0.0,
    ) -> Prediction:
        """The tip at encoder positions.

        Args:
            constants: of a geometry near that of x.
            x: the unknowns.
            theta: encoder positions in rad, (n, 6).
            loads: as `ArmLoads.at` gives them, (n, 5, 18).
            twist: of the tip, (n, 6).
            shapes: of the gears' errors, (n, 7, 6); None if there are none.
            time: since the camera's clock was compared first, s, (n,).
        """
        n = len(theta)
        out = np.empty((n, 4, 4)), np.empty((n, 6, self.size)), np.empty((n, 6))
        seen = self._seen(n, twist, shapes, time)
        kernels.tip.predict(constants, self.unknowns(x), theta, loads, seen, *out)
        return Prediction(*out)

    def innovation(
        self,
        constants: Constants,
        x: np.ndarray,
        pair: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
        shapes: np.ndarray | None = None,
        time: float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """How far the tip is seen from where it is predicted.

        Args:
            constants, x: as of `predict`.
            pair: encoder positions (6,), loads (5, 18), twist (6,) and the pose seen (4, 4) of one instant.
            shapes, time: of this instant, as of `predict`.

        Returns:
            The error (6,), rotation in rad first; its columns (6, size); deflections of gears in rad, (6,);
            the Jacobian of the tip, (6, 6).
        """
        theta, loads, twist, X_WE = pair
        r, H, gears = np.empty(6), np.empty((6, self.size)), np.empty(6)
        columns = np.empty((6, len(constants.frame)))
        seen = SeenOnce(twist, time, NO_SHAPES if shapes is None else shapes)
        out = r, H, gears, columns
        kernels.tip.innovation(constants, self.unknowns(x), theta, loads, seen, X_WE, *out)
        return r, H, gears, columns[:, :NUM_JOINTS]

    def predict_anew(
        self,
        constants: Constants,
        x: np.ndarray,
        configuration: tuple[np.ndarray, np.ndarray],
        motion: tuple[np.ndarray, np.ndarray],
        twist: np.ndarray,
        shapes: np.ndarray | None = None,
        time: np.ndarray | float = 0.0,
    ) -> Prediction:
        """The same with loads worked out anew at the geometry of now.

        Args:
            constants, x, twist, shapes, time: as in `predict`.
            configuration: encoder positions and about by how much the gears yield, in rad, (n, 6) each.
            motion: velocities and accelerations of the joints, (n, 6) each.
        """
        theta, gears = np.ascontiguousarray(configuration[0]), np.array(configuration[1])
        n = len(theta)
        out, loads = (np.empty((n, 4, 4)), np.empty((n, 6, self.size))), self.loads.masses
        unknowns, seen = self.unknowns(x), self._seen(n, twist, shapes, time)
        moving = np.concatenate(motion, axis=1)
        kernels.tip.predict_anew(constants, unknowns, loads, theta, gears, moving, seen, *out)
        return Prediction(*out, gears)

    def unknowns(self, x: np.ndarray) -> Unknowns:
        """A value of the unknowns as compiled functions take it."""
        return Unknowns(x, self.sigma, self.compliance)

    def _seen(self, n: int, twist: np.ndarray, shapes: np.ndarray | None, time: np.ndarray | float) -> Seen:
        if shapes is None:
            shapes = np.empty((n, 0, 6))
        times = np.empty(n)
        times[:] = time
        return Seen(np.ascontiguousarray(twist), times, np.ascontiguousarray(shapes))

    def warm_up(self) -> None:
        """Has everything compiled, or read from where it was kept, before it is wanted in a tick."""
        still, constants = np.zeros((1, 6)), self.constants(self.mean)
        arm = self.forward(constants, self.mean, still)[1]
        loads = self.loads.at(arm.frames, still, still, still)
        self.predict(constants, self.mean, still, loads, still)
        found = self.predict_anew(constants, self.mean, (still, still), (still, still), still)
        kernels.poses.pose_errors(found.X_WE, arm.X_WE)

    def tool_directions(self) -> np.ndarray:
        """A displaced tool in units of the spreads: columns for 2 mm along x, y, z and 5 mrad about them."""
        return self._tool

    def world_directions(self) -> np.ndarray:
        """A displaced base in units of the spreads: columns as of the tool, about axes of the world."""
        return self._world

    def joint_directions(self) -> np.ndarray:
        """Joints whose links have slipped against their encoders: columns for 5 mrad of each joint."""
        return self._zeros

    def displacement(self, tool: float, others: float) -> np.ndarray:
        """Covariance, (n, n), by a displaced tool and by camera and joints, by shares of spreads."""
        B, C = self._tool, np.hstack((self._world, self._zeros))
        return tool**2 * B @ B.T + others**2 * C @ C.T

    def _directions(self, body: int | None) -> np.ndarray:
        """Of a body's placement, or of the zeros of all joints."""
        found = self.identifiable
        independent, dependent = found.independent.tolist(), found.dependent.tolist()
        columns = []
        for i, entry in enumerate(self.parameters):
            if entry.kind != "offset" if body is None else entry.body != body:
                continue
            column = np.zeros(self.size)
            size = 2e-3 if entry.unit == "m" else 5e-3
            if i in independent:
                column[independent.index(i)] = size
            else:
                column[self.G] = size * found.combination[:, dependent.index(i)]
            columns.append(column / self.sigma)
        return np.array(columns).T


def moved(X_WE: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Poses (n, 4, 4), moved by small spatial displacements (n, 6) in world axes.

    The rotation is that of Cayley's formula: exact as a rotation, and the angle to third order.
    """
    out = X_WE.copy()
    kernels.poses.move_all(out, steps)
    return out
