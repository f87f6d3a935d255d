"""The equations of an elastic arm, linear about the measured motion of its motors.

The motors move as they have been measured, Reiner (2010) figure 4.2(c): the controller and the friction of
the motors are then no part of the model, and it is stable whatever its parameters are. Gears and structure
yield by little, so that their equations are linear about the moving arm:

    M(t) x'' + G(t) x' + K(t) (x - x_0) + h_0(t) = springs and dampers

G has the Coriolis and centrifugal terms of the moving arm and K what loads, gravity and counterbalance add to
the springs: without the two, stiffness comes out wrong by up to a half.
"""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces
from scipy.interpolate import CubicSpline

from robots.description.model import RobotModel
from robots.dynamics.plant import add_robot
from robots.identification.motion import MotionCase, SensorPlace

_TURN = 1e-6  # rad, of differences of torques that change over radians
_SPEED = 1e-3  # rad/s: torques are of second degree in speeds, and this is little beside the motion
_MOVING = 0.05  # of the largest speed of a case: slower motors stand still for the matrices


@dataclass(frozen=True)
class ArmAlongMotion:
    """One case; e sprung joints, c channels (three of a sensor), k knots, n samples.

    What changes with the posture is known at knots, to be interpolated linearly; what changes with the
    acceleration at all samples, or at some of them: motors of light robots start and stop from one sample to
    the next.
    """

    knots: np.ndarray  # (k,) samples
    mass: np.ndarray  # (k, e, e) kg m^2
    coriolis: np.ndarray  # (k, e, e) N m s / rad, G
    stiffness: np.ndarray  # (k, e, e) N m / rad, K
    rest: np.ndarray  # (k, e) rad, x_0
    by_turn: np.ndarray  # (k, c, e), d(reading) / d(x)
    by_speed: np.ndarray  # (k, c, e), d(reading) / d(x')
    by_acceleration: np.ndarray  # (k, c, e), d(reading) / d(x'')
    load: np.ndarray  # (n, e) N m, h_0
    readings: np.ndarray  # (n, c), of sensors on an arm that yields by x_0 and does not vibrate


class ElasticArm:
    """A robot with an elastic structure and sensors on it: torques and readings for any motion."""

    def __init__(self, robot: RobotModel, payload: float, sensors: list[SensorPlace]) -> None:
        """Builds the plant.

        Args:
            robot: of whose geometry and masses are used; stiffness and damping only for where it sags.
            payload: mass at the flange in kg.
            sensors: whose bodies the plant has.

        Raises:
            ValueError: if the robot may not carry the payload or has no such body.
        """
        self._plant = MultibodyPlant(0.0)
        self.parts = add_robot(self._plant, robot, "structure", payload)
        self._plant.Finalize()
        for sensor in sensors:
            if not self._plant.HasBodyNamed(sensor.body):
                raise ValueError(f"sensor '{sensor.name}': {robot.name} has no body '{sensor.body}'")
        self._sensors = sensors
        self._bodies = [self._plant.GetBodyByName(sensor.body) for sensor in sensors]
        self._rotations = np.array([sensor.rotation for sensor in sensors]).reshape(-1, 3, 3)  # R_BS
        self._of_sensors = [int(body.index()) for body in self._bodies]
        self._watched = dict(zip(self._of_sensors, self._bodies, strict=True))
        self._accelerating = [i for i, sensor in enumerate(sensors) if sensor.kind == "accelerometer"]
        # Scratch memory only: written before every use.
        self._context, self._forces = self._plant.CreateDefaultContext(), MultibodyForces(self._plant)
        self._gravity = self._plant.gravity_field().gravity_vector()
        self.size = self._plant.num_positions()
        self.motors = np.array([joint.position_start() for joint in self.parts.motors])
        self.sprung = np.array([joint.position_start() for joint in self.parts.sprung])
        self._springs = self.parts.sprung_stiffness
        self._dampers = np.array([joint.default_damping() for joint in self.parts.sprung])

    @property
    def names(self) -> list[str]:
        """Of the sprung joints."""
        return [joint.name() for joint in self.parts.sprung]

    def evaluate(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Torques on the sprung joints without their springs and dampers in N m, and what sensors show.

        Args:
            q, v, vdot: of all joints in rad and s, shape (size,) each.

        Returns:
            Shapes (e,) and (3 sensors,).
        """
        self._plant.SetPositionsAndVelocities(self._context, np.concatenate([q, v]))
        self._plant.CalcForceElementsContribution(self._context, self._forces)
        torques = self._plant.CalcInverseDynamics(self._context, vdot, self._forces)[self.sprung]
        torques = torques - self._springs * q[self.sprung] - self._dampers * v[self.sprung]
        accelerations = self._plant.CalcSpatialAccelerationsFromVdot(self._context, vdot)
        plant, context = self._plant, self._context
        rotations, turning = {}, {}  # R_WB, w_WB
        for index, body in self._watched.items():
            rotations[index] = plant.EvalBodyPoseInWorld(context, body).rotation().matrix()
            turning[index] = plant.EvalBodySpatialVelocityInWorld(context, body).rotational()
        R_WB = np.array([rotations[index] for index in self._of_sensors]).reshape(-1, 3, 3)
        shown = np.array([turning[index] for index in self._of_sensors]).reshape(-1, 3)
        for i in self._accelerating:
            p_BS_W, at_body = R_WB[i] @ self._sensors[i].position, accelerations[self._of_sensors[i]]
            shown[i] = at_body.Shift(p_BS_W, shown[i]).translational() - self._gravity
        return torques, (shown[:, None] @ R_WB @ self._rotations).ravel()

    def along(self, case: MotionCase, knot_time: float = 0.02, base_step: int = 1) -> ArmAlongMotion:
        """Linearises about a case.

        Args:
            case: whose motors move.
            knot_time: between knots in s while they do.
            base_step: samples from one at which the acceleration counts to the next; what is between them is
                interpolated.
        """
        theta, rate, acceleration = case.theta, case.rate, case.acceleration
        knots = _knots(case, knot_time)
        found = [self._linearised(theta[k], rate[k], acceleration[k]) for k in knots]
        mass, coriolis, stiffness, rest, by_turn, by_speed, by_acceleration = (
            np.array(each) for each in zip(*found, strict=True)
        )
        samples = np.arange(len(theta))
        x_0 = np.stack([np.interp(samples, knots, column) for column in rest.T], axis=1)
        base = np.unique(np.append(samples[::base_step], samples[-1]))
        at_base = [self._at(theta[k], rate[k], acceleration[k], x_0[k]) for k in base]
        load, readings = (interpolated(base, np.array(each), samples) for each in zip(*at_base, strict=True))
        return ArmAlongMotion(
            knots, mass, coriolis, stiffness, rest, by_turn, by_speed, by_acceleration, load, readings
        )

    def about(self, case: MotionCase, motion: ArmAlongMotion, moved: np.ndarray) -> ArmAlongMotion:
        """The same linear equations with what they lack where the arm yields and rings as it is said to.

        Terms of second degree (a sensor that deflections turn, on a hand that they accelerate) are some
        hundredths of the readings. Near to the motion that is given they are in load and readings then.

        Args:
            case: whose motors move.
            motion: linearised about it.
            moved: deflections, their rates and accelerations at the samples, (n, 3, e).
        """
        # What is lacking is small: every other sample shows it.
        samples = np.arange(len(case.theta))
        at_base = np.unique(np.append(samples[::2], samples[-1]))
        knot = np.clip(np.searchsorted(motion.knots, at_base, side="right") - 1, 0, len(motion.knots) - 2)
        share = (at_base - motion.knots[knot]) / np.diff(motion.knots)[knot]
        rest = (1.0 - share)[:, None] * motion.rest[knot] + share[:, None] * motion.rest[knot + 1]
        yielded = moved[at_base]
        torques = np.empty((len(at_base), motion.load.shape[1]))
        shown = np.empty((len(at_base), motion.readings.shape[1]))
        acceleration = case.acceleration
        for row, k in enumerate(at_base):
            q, v, vdot = self._joints(case.theta[k], case.rate[k], acceleration[k], moved[k, 0])
            v[self.sprung] += moved[k, 1]
            vdot[self.sprung] += moved[k, 2]
            torques[row], shown[row] = self.evaluate(q, v, vdot)
        yielded[:, 0] -= rest
        terms = (motion.stiffness, motion.coriolis, motion.mass)
        levers = (motion.by_turn, motion.by_speed, motion.by_acceleration)
        for parts, left in ((terms, torques), (levers, shown)):
            for matrix, vector in zip(parts, yielded.swapaxes(0, 1), strict=True):
                for weight, at in ((1.0 - share, knot), (share, knot + 1)):
                    left -= weight[:, None] * np.einsum("nij,nj->ni", matrix[at], vector)
        load = motion.load + interpolated(at_base, torques - motion.load[at_base], samples)
        readings = motion.readings + interpolated(at_base, shown - motion.readings[at_base], samples)
        return replace(motion, load=load, readings=readings)

    def _at(
        self, theta: np.ndarray, rate: np.ndarray, acceleration: np.ndarray, x_0: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        return self.evaluate(*self._joints(theta, rate, acceleration, x_0))

    def _joints(
        self, theta: np.ndarray, rate: np.ndarray, acceleration: np.ndarray, x_0: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        q, v, vdot = np.zeros((3, self.size))
        q[self.motors], v[self.motors], vdot[self.motors] = theta, rate, acceleration
        q[self.sprung] += x_0  # of a motor: beyond where it was measured
        return q, v, vdot

    def _linearised(
        self, theta: np.ndarray, rate: np.ndarray, acceleration: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Mass, Coriolis, stiffness, rest and the derivatives of the readings at an instant."""
        still = np.zeros(len(self.sprung))
        torques, _ = self._at(theta, 0.0 * rate, 0.0 * rate, still)
        x_0 = np.divide(-torques, self._springs, out=still, where=self._springs > 0.0)
        q, v, vdot = self._joints(theta, rate, acceleration, x_0)
        torques, shown = self.evaluate(q, v, vdot)
        n = len(self.sprung)
        stiffness, coriolis = np.empty((n, n)), np.empty((n, n))
        by_turn, by_speed = np.empty((len(shown), n)), np.empty((len(shown), n))
        for column, row in enumerate(self.sprung):
            for changed, step, of_torque, of_shown in (
                (q, _TURN, stiffness, by_turn),
                (v, _SPEED, coriolis, by_speed),
            ):
                before = changed[row]
                changed[row] = before + step
                more, more_shown = self.evaluate(q, v, vdot)
                changed[row] = before
                of_torque[:, column] = (more - torques) / step
                of_shown[:, column] = (more_shown - shown) / step
        self._plant.SetPositions(self._context, q)
        mass = self._plant.CalcMassMatrix(self._context)[np.ix_(self.sprung, self.sprung)]
        return mass, coriolis, stiffness, x_0, by_turn, by_speed, self._levers()

    def _levers(self) -> np.ndarray:
        """d(reading) / d(x'') at the positions of the context."""
        world, rows = self._plant.world_frame(), []
        for sensor, body in zip(self._sensors, self._bodies, strict=True):
            if sensor.kind == "gyro":
                rows.append(np.zeros((3, len(self.sprung))))
                continue
            J = self._plant.CalcJacobianTranslationalVelocity(
                self._context, JacobianWrtVariable.kV, body.body_frame(), sensor.position, world, world
            )
            R_WB = self._plant.EvalBodyPoseInWorld(self._context, body).rotation().matrix()
            rows.append((R_WB @ sensor.rotation).T @ J[:, self.sprung])
        return np.concatenate(rows)


def interpolated(known: np.ndarray, values: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """A cubic spline through values (b, c) that are known at some samples (b,), at all samples (n,)."""
    return CubicSpline(known, values)(samples)


def _knots(case: MotionCase, knot_time: float) -> np.ndarray:
    """The first sample, the last one, and in between some while the motors move."""
    speed, last = np.abs(case.rate).max(1), len(case.theta) - 1
    moving = np.flatnonzero(speed > _MOVING * speed.max())
    if not len(moving):
        return np.array([0, last])
    step = max(1, round(knot_time / case.period))
    between = np.arange(moving[0], moving[-1] + step, step)
    return np.unique(np.concatenate([[0], between[between < last], [last]]))
