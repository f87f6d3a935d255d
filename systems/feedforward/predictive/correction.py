"""The predictive correction: torques for what friction leaves, a little before it is left."""

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiscreteValues

from robots.description.model import NUM_JOINTS
from robots.dynamics.friction_line import friction_line
from robots.dynamics.modes import ModalAnalysis, stretched
from robots.dynamics.plant import add_robot
from robots.kinematics.forward import Kinematics, robust_solve
from systems.controller_model import ControllerModel
from systems.feedforward.predictive.config import PredictiveConfig
from systems.feedforward.predictive.forecast import Cascade, Forecast
from systems.feedforward.predictive.friction_observer import FrictionObserver
from systems.feedforward.predictive.program import CorrectionProgram
from systems.reference.reference import PathAhead
from systems.sampled_system import SampledSystem
from systems.samples import JointSample

_FADING = 0.8  # of the correction, at every tick without a sample to go by: half of it is gone after three
_SLOWER = 1.3  # of 1 / w^2: a correction that is as quick as the arm makes it ring
_FOLLOWS = 0.01  # rad: a motor farther from its command is not held back by friction
_OWN = 3 * NUM_JOINTS  # what the integral gives, error and its rate at the last tick


class PredictiveCorrection(SampledSystem):
    """Looks ahead at every tick and corrects the torques that a feedforward tells the drives.

    Ports:
        in  ``reference``         PathAhead, for the speeds that are planned
        in  ``position_command``  vector 6 in rad, as it was issued last
        in  ``velocity_command``  vector 6 in rad/s, likewise
        in  ``joint_sample``      JointSample
        out ``torque``            vector 6 in N m, joint side, to be added to the torque feedforward

    From the errors of the motors at two ticks, and from what the drives make of them, comes what the motors
    needed in between beyond the feedforward. `FrictionObserver` parts it into what ends with the motion and
    what stays, `CorrectionProgram` finds the torques with which the motors stay closest to their commands,
    and the first one is added.

    Only what encoders of the motors see is corrected: not that gears and links bend otherwise than believed,
    nor play. The correction is never above a share of the believed Coulomb friction. Without a sample of this
    tick, without commands and while motors are far from them it fades, and the feedforward is alone.

    Attributes:
        delay: ticks from a torque's issue to its effect.
    """

    def __init__(self, model: ControllerModel, config: PredictiveConfig) -> None:
        """Builds model, observer and program.

        Args:
            model: what the controller believes of the robot, its load and the delays.
            config: horizon, weights, and what is believed of the drives.
        """
        super().__init__()
        robot, period = model.robot, model.period
        self._period, self._late = period, model.preview - model.command_delay
        self._behind = max(model.command_delay / period, 1.0)  # ticks from a command's issue to its motion
        self.delay = int(np.ceil(self._behind - 1e-9))
        stiffness = config.velocity * (config.position + config.integral)
        cascade = Cascade(stiffness, config.velocity, config.velocity * config.position * config.integral)
        ticks = self.delay + max(2, round(config.horizon / period))
        self._cascade = cascade
        weight = config.smoothness or smoothness(model)
        self._program = CorrectionProgram(cascade, weight, period, ticks)
        self._plant = MultibodyPlant(0.0)
        add_robot(self._plant, robot, "rigid", model.payload)
        self._plant.Finalize()
        # Scratch memory only: written before every use.
        self._context = self._plant.CreateDefaultContext()
        self._tuned_for = np.diag(self._plant.CalcMassMatrix(self._context)).copy()
        coulomb, viscous = (each / self._tuned_for for each in friction_line(robot))
        self._observer = FrictionObserver(coulomb, viscous, robot.coulomb_velocity)
        self._limit = config.limit * coulomb
        self._kinematics = Kinematics(robot)
        self._ahead = period * np.arange(ticks + 1)
        self._reference = self.DeclareAbstractInputPort("reference", Value[object]())
        self._position = self.DeclareVectorInputPort("position_command", NUM_JOINTS)
        self._velocity = self.DeclareVectorInputPort("velocity_command", NUM_JOINTS)
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        self._torque = self.DeclareDiscreteState(NUM_JOINTS)
        self.DeclareStateOutputPort("torque", self._torque)
        # Torques of the last ticks in rad/s^2, positions and velocities of the commands; the newest first.
        self._sent = self.DeclareDiscreteState((self.delay + 1) * NUM_JOINTS)
        self._commands = self.DeclareDiscreteState(np.full((self.delay + 1) * 2 * NUM_JOINTS, np.nan))
        unknown = np.full(_OWN, np.nan)
        unknown[:NUM_JOINTS] = 0.0
        self._own = self.DeclareDiscreteState(unknown)
        self._parts = self.DeclareDiscreteState(self._observer.at_first)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._tick)

    def _tick(self, context: Context, discrete_state: DiscreteValues) -> None:
        time, sample = context.get_time(), self._joints.Eval(context)
        sent = context.get_discrete_state(self._sent).value().reshape(-1, NUM_JOINTS)
        told = context.get_discrete_state(self._commands).value().reshape(-1, 2, NUM_JOINTS)
        command = np.stack([self._position.Eval(context), self._velocity.Eval(context)])
        told = np.concatenate([command[None], told[:-1]])
        due = self._due(told)
        error = due - np.stack([sample.position, sample.velocity])
        correction = None
        own = context.get_discrete_state(self._own).value().copy()
        if self._is_usable(time, sample, error[0]):
            speed = self._planned_speed(self._reference.Eval(context), time, told[0, 0])
            inertia = self._inertia(sample.position)
            own, parts = self._observed(context, error, speed[0], sent[-1], inertia)
            discrete_state.set_value(int(self._parts), parts)
            upper = np.tile(self._limit, (self._program.ticks, 1))
            lower = -upper
            lower[: self.delay] = upper[: self.delay] = sent[: self.delay][::-1]
            slope, needed = self._observer.slope(speed[1:]), self._observer.ahead(parts, speed[1:])
            forecast = Forecast(error[0], error[1], own[:NUM_JOINTS], inertia, slope, needed, lower, upper)
            found = self._program.solve(forecast)
            correction = None if found is None else found[self.delay]
        else:
            own[NUM_JOINTS:] = np.nan
        if correction is None:
            correction = _FADING * sent[0]
        discrete_state.set_value(int(self._torque), self._tuned_for * correction)
        discrete_state.set_value(int(self._sent), np.concatenate([correction, sent[:-1].ravel()]))
        discrete_state.set_value(int(self._commands), told.ravel())
        discrete_state.set_value(int(self._own), own)

    def _is_usable(self, time: float, sample: JointSample, error: np.ndarray) -> bool:
        """Whether a sample at a time in s tells what friction does; errors in rad, NaN without a command."""
        is_of_now = sample.running and abs(time - sample.time) < 0.5 * self._period
        return is_of_now and bool(np.all(np.abs(error) < _FOLLOWS))

    def _due(self, told: np.ndarray) -> np.ndarray:
        """Position and velocity at which the motors should be now, (2, 6): between the commands that were."""
        newer = int(self._behind + 1e-9) - 1
        share = self._behind - 1.0 - newer
        if share < 1e-6:
            return told[newer]
        (p, v), (p_old, v_old) = told[newer], told[newer + 1]
        # A cubic through both, backwards in time.
        s, T = share, self._period
        position = (
            (1.0 + 2.0 * s) * (1.0 - s) ** 2 * p
            - s * (1.0 - s) ** 2 * T * v
            + s**2 * (3.0 - 2.0 * s) * p_old
            + s**2 * (1.0 - s) * T * v_old
        )
        return np.stack([position, (1.0 - s) * v + s * v_old])

    def _planned_speed(self, reference: PathAhead, time: float, q: np.ndarray) -> np.ndarray:
        """Of the motors now and at the ticks ahead in rad/s, (n + 1, 6), with the Jacobian of now."""
        times = time + self._late + self._ahead
        if reference.time is None:  # then a tick's twist is known already
            twists = np.array([reference.moment(t, self._late).V_WE for t in times])
        else:
            twists = reference.sample(times)[1]
        J = self._kinematics.jacobian(q)
        return robust_solve(J, twists.T).T

    def _inertia(self, q: np.ndarray) -> np.ndarray:
        """What each motor has to turn at positions in rad, as a share of what its drive is tuned for."""
        self._plant.SetPositions(self._context, q)
        return np.diag(self._plant.CalcMassMatrix(self._context)) / self._tuned_for

    def _observed(
        self,
        context: Context,
        error: np.ndarray,
        speed: np.ndarray,
        acted: np.ndarray,
        inertia: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """What the integrals give now with errors and rates, (18,), and the observer's memory.

        Args:
            context: of the last tick.
            error: and its rate now, (2, 6).
            speed: planned, in rad/s, (6,).
            acted: the correction in rad/s^2 that acted since the last tick, (6,).
            inertia: see `Forecast`.
        """
        integral, *last = np.split(context.get_discrete_state(self._own).value(), 3)
        parts = context.get_discrete_state(self._parts).value()
        if np.isnan(last[0][0]):
            return np.concatenate([integral, *error]), parts
        T, c = self._period, self._cascade
        e, rate = 0.5 * (error + np.stack(last))
        grown = integral + c.integral * T * e
        moved = inertia * (error[1] - last[1]) / T + (c.derivative + self._observer.slope(speed)) * rate
        needed = moved + c.proportional * e + 0.5 * (integral + grown) + acted
        return np.concatenate([grown, *error]), self._observer.updated(parts, needed, speed)


def smoothness(model: ControllerModel) -> float:
    """lambda_u in s^2 for an arm with this load."""
    elasticity = "joints" if model.elasticity == "rigid" else model.elasticity
    modes = ModalAnalysis(model.robot, elasticity, model.payload).at(stretched(model.robot))
    return _SLOWER / float(modes.angular_frequency[0]) ** 2
