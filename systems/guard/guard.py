"""Supervision of the commands: limits, missing commands, lost measurements and the smooth stop."""

import importlib
import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.forward import Kinematics, robust_solve
from systems.guard import state as at
from systems.guard.config import KINDS, GuardConfig
from systems.guard.jerk_limits import JerkLimits
from systems.guard.joint_limits import JointLimits
from systems.guard.way_back import shortest_way, way_left
from systems.sampled_system import SampledSystem
from systems.samples import JointSample

_VELOCITY, _ACCELERATION, _POSITION, _CORRECTION, _NO_COMMAND, _REFUSED, _HELD, _STOPPED, _RESUMED = range(
    len(KINDS)
)

_ABSURD = 1e6  # rad and rad/s in sum: no command, and squares of it would not be numbers
_GRACE = 1.05  # times its limit that a correction may reach: where a law stops it, it may overshoot by a step
_NO_DEVIATION, _UNKNOWN = np.zeros(NUM_JOINTS), np.full(NUM_JOINTS, np.nan)
# With these a torque would not belong to the motion that it was computed for.
_NOT_FOLLOWED = (_NO_COMMAND, _STOPPED, _VELOCITY, _ACCELERATION, _POSITION)


class CommandGuard(SampledSystem):
    """Passes a law's command on, made safe.

    Ports:
        in  ``position_command``  vector 6 in rad, NaN where the law finds no solution
        in  ``velocity_command``  vector 6 in rad/s
        in  ``correction``        vector 6 in rad and m, rotation first
        in  ``measurement``       vector 3: when the last usable sample arrived (s), how many were refused,
                                  when the newest one was exposed (s)
        in  ``joint_sample``      JointSample
        out ``decision``          vector, see `systems.guard.state`; its first twelve numbers are the command:
                                  positions in rad, finite, in range, within speed and acceleration, and
                                  velocities in rad/s, likewise
    and where torques are fed forward:
        in  ``torque_feedforward``  vector 6 in N m
        out ``torque_feedforward``  vector 6 in N m, zero while the law's command is not followed
    in any case:
        out ``guard_status``      vector: how many ticks each of `KINDS` has happened, in that order
        out ``deviation``         vector 6 in rad: where the joints were led at the last tick less where the
                                  law would have had them

    The command that was issued last is the state; the output is computed from it and the law's newest
    command, without delay. Before the first command, and while the robot does not run, the output is the
    measured position (NaN as long as that was never known); when it runs again it is led smoothly from there
    to what the law commands then, and likewise after a law or its joints have been silent.
    """

    def __init__(
        self,
        robot: RobotModel,
        config: GuardConfig,
        period: float,
        correction_limit: float,
        correction_limit_deg: float,
        uses_camera: bool = True,
        passes_torque: bool = False,
        is_speed_only: bool = False,
    ) -> None:
        """Checks the configuration.

        Args:
            robot: whose limits count.
            config: what is allowed.
            period: time between commands in s.
            correction_limit: the law's limit in m; reaching it is counted.
            correction_limit_deg: the same for the orientation.
            uses_camera: False for a law that does without samples, so that a blind camera does not stop it.
            passes_torque: whether there are ports for a torque feedforward.
            is_speed_only: whether the robot follows velocities alone, and the law commands from where it is.

        Raises:
            ValueError: if a time is not positive, or the stop would come before the hold.
        """
        super().__init__()
        if not 0.0 < config.hold_after < config.stop_after:
            raise ValueError(
                "guard: 0 < hold_after < stop_after is needed, got "
                f"{config.hold_after} s and {config.stop_after} s"
            )
        if not (config.stop_time > 0.0 and config.resume_time > 0.0 and 0.0 < config.speed_share <= 1.0):
            raise ValueError(
                "guard: stop_time and resume_time must be positive and speed_share in (0, 1], got "
                f"{config.stop_time} s, {config.resume_time} s and {config.speed_share}"
            )
        self._config, self._period = config, period
        self._is_speed_only = is_speed_only
        self._limits = JointLimits(robot, config.speed_share)
        self._rows = self._limits.rows(period)
        self._jerk = JerkLimits(self._limits)
        self._kinematics = Kinematics(robot)
        # Not before a guard is made: it takes time to import.
        self._kernels = importlib.import_module("systems.guard.kernels")
        self._kernels.warm_up()
        # A hundred-thousandth below, because a law's own clipping rounds.
        self._correction_limit = (1.0 - 1e-5) * correction_limit
        self._correction_angle = (1.0 - 1e-5) * np.deg2rad(correction_limit_deg)
        limits = self._rows, self._correction_angle, self._correction_limit
        self._usual = *limits, _ABSURD, is_speed_only, period
        self._times = uses_camera, config.hold_after, config.stop_after, config.resume
        self._inputs = [
            self.DeclareVectorInputPort(name, size)
            for name, size in (
                ("position_command", NUM_JOINTS),
                ("velocity_command", NUM_JOINTS),
                ("correction", 6),
                ("measurement", 3),
            )
        ]
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        unknown = np.zeros(at.WIDTH)
        unknown[at.ISSUED], unknown[at.FIRST_TICK], unknown[at.LAST_COMMAND] = np.nan, np.inf, -np.inf
        state = self.DeclareDiscreteState(unknown)
        counts = self.DeclareDiscreteState(len(KINDS))
        self.DeclareStateOutputPort("guard_status", counts)
        self.DeclareStateOutputPort("deviation", self.DeclareDiscreteState(NUM_JOINTS))
        # One port for all of it: every further one would be a call from Drake into Python.
        decided_by = {port.ticket() for port in (*self._inputs, self._joints)}
        decided_by.add(self.discrete_state_ticket(state))
        self._decision = self.DeclareVectorOutputPort(
            "decision", at.DECISION_WIDTH, self._calc_decision, decided_by
        )
        if passes_torque:
            torque = self.DeclareVectorInputPort("torque_feedforward", NUM_JOINTS)
            self._torque = torque
            prerequisites = {*decided_by, torque.ticket()}
            self.DeclareVectorOutputPort("torque_feedforward", NUM_JOINTS, self._calc_torque, prerequisites)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        counted, torque = self._decision.Eval(context)[at.COUNTED], self._torque.Eval(context)
        follows = not any(counted[kind] for kind in _NOT_FOLLOWED)
        output.set_value(torque if follows and np.isfinite(torque).all() else np.zeros(NUM_JOINTS))

    def _calc_decision(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state(0).value()
        position, velocity, correction, measurement = (port.Eval(context) for port in self._inputs)
        law = position, velocity, correction
        joints: JointSample = self._joints.Eval(context)
        decision = output.get_mutable_value()
        asked = state, *law, measurement, joints.position, *self._usual, decision
        if joints.running and not self._jerk.is_given and self._kernels.decided(*asked):
            return
        are_known = math.isfinite(sum(joints.position.tolist()))
        # While the robot runs and has been commanded before, its joints do not matter for what is issued.
        is_in_motion = joints.running and not math.isnan(state[0])
        next_state, kinds = self._decided(state, *law, joints, are_known, is_in_motion)
        decision[: at.WIDTH], decision[at.COUNTED] = next_state, 0.0
        decision[at.COUNTED][kinds] = 1.0
        decision[at.JOINTS] = joints.position if are_known and is_in_motion else np.nan
        self._kernels.note_camera(decision, measurement)

    def _decided(
        self,
        state: np.ndarray,
        position: np.ndarray,
        velocity: np.ndarray,
        correction: np.ndarray,
        joints: JointSample,
        are_joints_known: bool,
        is_in_motion: bool,
    ) -> tuple[np.ndarray, list[int]]:
        """The next state and the kinds of intervention it takes, whatever has happened."""
        is_led_by_joints = are_joints_known and not is_in_motion
        state, kinds = state.copy(), []
        if is_led_by_joints:
            _take_from(state, joints)
        if not are_joints_known:
            kinds.append(_REFUSED)
            position, state[at.VELOCITIES] = _UNKNOWN, np.nan_to_num(state[at.VELOCITIES])
        last = state.copy() if self._jerk.is_given else None
        excess = self._kernels.excess(correction, self._correction_angle, self._correction_limit)
        if excess > 0.0:
            kinds.append(_CORRECTION)
            if excess > _GRACE and self._config.on_correction_limit == "stop":
                state[at.MODE] = at.STOPPING
            elif excess > _GRACE:
                position, velocity = self._within_correction(position, velocity, correction)
        if is_led_by_joints and not joints.running and state[at.LAST_COMMAND] > -math.inf:
            kinds.append(_STOPPED)
            state[at.BRAKING_FROM] = 0.0
            state[at.MODE] = at.IDLE
        elif state[at.MODE] == at.STOPPING:
            kinds.append(_STOPPED)
            self._brake(state)
            if self._kernels.is_command(_NO_DEVIATION, velocity, _ABSURD):
                state[at.ASIDE] += self._period * (state[at.VELOCITIES] - velocity)
        elif not self._kernels.is_command(position, velocity, _ABSURD):
            # Before the first command a law is silent by right.
            if state[at.LAST_COMMAND] > -math.inf:
                kinds.append(_NO_COMMAND)
            self._brake(state)
        else:
            if state[at.MODE] in (at.IDLE, at.RESUMING) or (
                state[at.MODE] == at.AWAY and not self._may_follow(state, position, velocity)
            ):
                kinds.append(_RESUMED)
                position, velocity = self._back(state, position, velocity)
            self._follow(state, position, velocity, kinds)
        if last is not None:
            self._ease(state, last, kinds)
        return state, kinds

    def _within_correction(
        self, position: np.ndarray, velocity: np.ndarray, correction: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """A command without the part of its correction that is beyond the limit; NaN if there is none."""
        excess = correction.copy()
        if not (np.isfinite(position).all() and np.isfinite(excess).all()):
            return _UNKNOWN, velocity
        for part, limit in ((slice(0, 3), self._correction_angle), (slice(3, 6), self._correction_limit)):
            size = float(np.linalg.norm(excess[part]))
            excess[part] *= max(0.0, 1.0 - _GRACE * limit / size) if size else 0.0
        too_far = robust_solve(self._kinematics.jacobian(position), excess)
        if self._is_speed_only:
            return position, velocity - too_far / self._config.stop_time
        return position - too_far, velocity

    def _places(
        self, state: np.ndarray, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """From where the next step begins and from where the last one did, (6,) each in rad."""
        if not self._is_speed_only:
            return state[at.POSITIONS], state[at.BEFORE]
        # Such a law commands from where the robot is, which what was issued before does not tell.
        now = position - self._period * velocity
        return now, now - self._period * state[at.VELOCITIES]

    def _may_follow(self, state: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> bool:
        start, before = self._places(state, position, velocity)
        return self._kernels.is_allowed(self._rows, position, velocity, start, before, state[at.VELOCITIES])

    def _follow(
        self, state: np.ndarray, position: np.ndarray, velocity: np.ndarray, kinds: list[int]
    ) -> None:
        """Goes to the law's command as far as the limits allow."""
        if self._may_follow(state, position, velocity):
            state[at.BEFORE] = state[at.POSITIONS]
            state[at.POSITIONS], state[at.VELOCITIES] = position, velocity
            state[at.BRAKING_FROM] = velocity
            return
        limits, period = self._limits, self._period
        start, before = self._places(state, position, velocity)
        goal, rate = position, velocity
        excess = max(1.0, float((np.abs(rate) / limits.speed).max()))
        if self._jerk.is_given:  # which finds the way there itself, within all limits
            kinds += [_POSITION] if ((goal < limits.lower) | (goal > limits.upper)).any() else []
            kinds += [_VELOCITY] if excess > 1.0 else []
            state[at.BEFORE], state[at.VELOCITIES] = state[at.POSITIONS], rate / excess
            state[at.POSITIONS] = np.minimum(np.maximum(goal, limits.lower), limits.upper)
            return
        mean, faster = limits.step(start, (start - before) / period, goal, rate / excess, period)
        issued = limits.moved(start, mean, period)
        if ((goal < limits.lower) | (goal > limits.upper)).any():
            kinds.append(_POSITION)
        if max(excess, faster) > 1.0 + 1e-9:
            kinds.append(_VELOCITY)
        has_arrived = np.abs(issued - goal) < 1e-12
        if not (has_arrived.all() or {_POSITION, _VELOCITY}.intersection(kinds)):
            kinds.append(_ACCELERATION)
        change = period * limits.acceleration
        last = state[at.VELOCITIES]
        rate = np.where(has_arrived, rate / excess, mean)
        state[at.BEFORE] = state[at.POSITIONS]
        state[at.POSITIONS] = issued
        state[at.VELOCITIES] = np.minimum(np.maximum(rate, last - change), last + change)
        state[at.BRAKING_FROM] = state[at.VELOCITIES]

    def _ease(self, state: np.ndarray, last: np.ndarray, kinds: list[int]) -> None:
        """Keeps the jerk of what has been decided, ``last`` being the state before, in place."""
        if math.isnan(last[0]) or math.isnan(last[at.BEFORE][0]):
            return
        period, is_braking = self._period, not {_STOPPED, _NO_COMMAND}.isdisjoint(kinds)
        position, goal, rate = last[at.POSITIONS], state[at.POSITIONS], state[at.VELOCITIES]
        both = period, period
        was, speeding = last[at.VELOCITIES], last[at.SPEEDING]
        velocity = (self._jerk.braked if is_braking else self._jerk.eased)(was, speeding, rate, both)
        if not self._is_speed_only:
            speed, turning = (position - last[at.BEFORE]) / period, last[at.TURNING]
            if is_braking:
                mean = self._jerk.eased(speed, turning, 0.5 * (was + velocity), both, position)
            else:
                mean = self._jerk.followed(position, speed, turning, goal, rate, both)
            if is_braking or not np.array_equal(mean, (goal - position) / period):
                state[at.POSITIONS] = self._limits.moved(position, mean, period)
                kinds += [] if is_braking else [_ACCELERATION]
            state[at.TURNING] = (mean - speed) / period
        state[at.VELOCITIES], state[at.SPEEDING] = velocity, (velocity - was) / period
        if not is_braking:
            state[at.BRAKING_FROM] = velocity

    def _back(
        self, state: np.ndarray, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The law's command and what is left of the distance to it after a stop or a silence."""
        if state[at.MODE] != at.RESUMING:
            # As it was a tick ago, when the robot was where it is.
            offset = state[at.POSITIONS] - (position - self._period * velocity)
            if self._is_speed_only:
                offset = state[at.ASIDE].copy()
            rate = state[at.VELOCITIES] - velocity
            state[at.OFFSET], state[at.OFFSET_RATE] = offset, rate
            state[at.WAY] = max(self._config.resume_time, shortest_way(self._limits, offset, rate))
            state[at.DONE], state[at.MODE] = 0.0, at.RESUMING
        state[at.DONE] = min(1.0, state[at.DONE] + self._period / state[at.WAY])
        left, left_rate = way_left(state[at.DONE], state[at.WAY], state[at.OFFSET], state[at.OFFSET_RATE])
        if state[at.DONE] >= 1.0:
            state[at.MODE] = at.GOING
        state[at.ASIDE] = left
        return position if self._is_speed_only else position + left, velocity + left_rate

    def _brake(self, state: np.ndarray) -> None:
        """Slows all joints down evenly, from full motion to rest in ``stop_time``, or as fast as they may."""
        limits, period = self._limits, self._period
        start, last = state[at.BRAKING_FROM], state[at.VELOCITIES].copy()
        position = state[at.POSITIONS].copy()
        top = float(np.abs(start).max())
        share = 0.0
        if top > 0.0:
            hardest = float((limits.acceleration / np.maximum(np.abs(start), 1e-12)).min())
            less = period * min(1.0 / self._config.stop_time, hardest)
            share = max(0.0, float(np.abs(last).max()) / top - less)
        mean = (position - state[at.BEFORE]) / period
        if math.isnan(mean[0]):
            return
        velocity = limits.bounded(position, last, share * start, period, period)
        step = 0.5 * (last + velocity)
        if not self._is_speed_only:  # whose positions are not followed, and may have been anywhere
            step = limits.bounded(position, mean, step, period, period)
        state[at.BEFORE], state[at.POSITIONS] = position, limits.moved(position, step, period)
        state[at.VELOCITIES] = velocity

    def hear(self, context: Context) -> None:
        """Takes note of where the joints were at the last tick, which was done before that was known."""
        joints: JointSample = self._joints.Eval(context)
        context.get_mutable_discrete_state(0).get_mutable_value()[at.WERE_AT] = joints.position

    def _remember(self, context: Context, discrete_state: DiscreteValues) -> None:
        """Makes the issued command the state and decides from the clocks how the next tick will go."""
        decision, state = self._decision.Eval(context), discrete_state.get_mutable_value(0)
        if not self._kernels.remember(decision, context.get_time(), *self._times, state):
            wished = self._inputs[0].Eval(context)
            aside = state[at.ASIDE] if self._is_speed_only else state[at.POSITIONS] - wished
            aside = aside if math.isfinite(sum(aside.tolist())) else _NO_DEVIATION
            state[at.DEVIATES] = float(aside.any())
            discrete_state.set_value(2, aside)
            discrete_state.set_value(1, context.get_discrete_state(1).value() + decision[at.COUNTED])


def _take_from(state: np.ndarray, joints: JointSample) -> None:
    """Puts the state where the joints are, at rest."""
    if state[at.MODE] in (at.GOING, at.HOLDING):
        state[at.ASIDE] = 0.0
    if not math.isnan(state[0]):
        state[at.ASIDE] += joints.position - state[at.WERE_AT]
    state[at.POSITIONS], state[at.VELOCITIES] = joints.position, 0.0
    state[at.TURNING], state[at.SPEEDING] = 0.0, 0.0
    state[at.BEFORE] = state[at.WERE_AT] = joints.position
