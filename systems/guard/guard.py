"""Supervision of the commands: limits, missing commands, lost measurements and the smooth stop."""

import importlib
import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.forward import Kinematics, robust_solve
from systems.guard import state as at
from systems.guard.config import KINDS, GuardConfig
from systems.guard.jerk_limits import JerkLimits
from systems.guard.joint_limits import JointLimits
from systems.guard.way_back import shortest_way, way_left
from systems.samples import JointSample

_VELOCITY, _ACCELERATION, _POSITION, _CORRECTION, _NO_COMMAND, _REFUSED, _HELD, _STOPPED, _RESUMED = range(
    len(KINDS)
)

_ABSURD = 1e6  # rad and rad/s in sum: no command, and squares of it would not be numbers
_GRACE = 1.05  # times its limit that a correction may reach: where a law stops it, it may overshoot by a step
_NO_DEVIATION, _UNKNOWN = np.zeros(NUM_JOINTS), np.full(NUM_JOINTS, np.nan)


class CommandGuard(LeafSystem):
    """Passes a law's command on, made safe.

    Ports:
        in  ``position_command``  vector 6 in rad, NaN where the law finds no solution
        in  ``velocity_command``  vector 6 in rad/s
        in  ``correction``        vector 6 in rad and m, rotation first
        in  ``measurement``       vector 3: when the last usable sample arrived (s), how many were refused,
                                  when the newest one was exposed (s)
        in  ``joint_sample``      JointSample
        out ``position_command``  vector 6 in rad: finite, in range, within speed and acceleration
        out ``velocity_command``  vector 6 in rad/s, likewise
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
        self._config, self._period, self._uses_camera = config, period, uses_camera
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
        self._correction_limits = self._correction_angle, self._correction_limit
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
        decided_by = {port.ticket() for port in self._inputs} | {self.discrete_state_ticket(state)}
        # While the robot runs, its joints do not matter for what is issued: they need not be waited for.
        self._next_in_motion = self.DeclareCacheEntry(
            "next_in_motion", ValueProducer(Value[object], self._calc_next_in_motion), decided_by
        )
        # This one computes everything; the ports are slices of it.
        self._next = self.DeclareCacheEntry(
            "next", ValueProducer(Value[object], self._calc_next), decided_by | {self._joints.ticket()}
        )
        for name, part in (("position_command", at.POSITIONS), ("velocity_command", at.VELOCITIES)):
            self.DeclareVectorOutputPort(name, NUM_JOINTS, self._slice(part), {self._next.ticket()})
        if passes_torque:
            torque = self.DeclareVectorInputPort("torque_feedforward", NUM_JOINTS)
            self._torque = torque
            prerequisites = {self._next.ticket(), torque.ticket()}
            self.DeclareVectorOutputPort("torque_feedforward", NUM_JOINTS, self._calc_torque, prerequisites)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def _slice(self, part: slice):
        def calc(context: Context, output: BasicVector) -> None:
            output.set_value(self._next.Eval(context)[0][part])

        return calc

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        kinds, torque = self._next.Eval(context)[1], self._torque.Eval(context)
        # A torque belongs to the motion that it was computed for.
        follows = not {_NO_COMMAND, _STOPPED, _VELOCITY, _ACCELERATION, _POSITION}.intersection(kinds)
        output.set_value(torque if follows and np.isfinite(torque).all() else np.zeros(NUM_JOINTS))

    def _calc_next(self, context: Context, value) -> None:
        """The next state, the kinds of intervention it takes, the time of the last sample, the joints."""
        joints: JointSample = self._joints.Eval(context)
        has_issued = not math.isnan(context.get_discrete_state(0).value()[0])
        if not math.isfinite(sum(joints.position.tolist())):
            value.set_value((*self._decided(context, None, are_joints_known=False), None))
        elif not (joints.running and has_issued):
            value.set_value((*self._decided(context, joints), None))
        else:
            value.set_value((*self._next_in_motion.Eval(context), joints.position))

    def _calc_next_in_motion(self, context: Context, value) -> None:
        value.set_value(self._decided(context, None))

    def _decided(
        self, context: Context, joints: JointSample | None, are_joints_known: bool = True
    ) -> tuple[np.ndarray, list[int], float]:
        """What `_calc_next` says; no joints stand for a robot that runs and has been commanded before."""
        state = context.get_discrete_state(0).value()
        position, velocity, correction, measurement = (port.Eval(context) for port in self._inputs)
        if joints is None and are_joints_known and not self._jerk.is_given:
            follow = self._kernels.follow
            limits = self._rows, *self._correction_limits, _ABSURD, self._is_speed_only, self._period
            followed, is_followed = follow(state, position, velocity, correction, *limits)
            if is_followed:
                return followed, *_seen(followed, [], measurement)
        state, kinds = state.copy(), []
        if joints is not None:
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
        if joints is not None and not joints.running and state[at.LAST_COMMAND] > -math.inf:
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
        return state, *_seen(state, kinds, measurement)

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
        state, kinds, last_sample, were_at = self._next.Eval(context)
        config, has_no_command = self._config, _NO_COMMAND in kinds
        times = config.hold_after, config.stop_after, config.resume
        state = self._kernels.remembered(
            state, context.get_time(), last_sample, self._uses_camera, has_no_command, *times
        )
        if were_at is not None:
            state[at.WERE_AT] = were_at
        if kinds or state[at.DEVIATES]:
            wished = self._inputs[0].Eval(context)
            aside = state[at.ASIDE] if self._is_speed_only else state[at.POSITIONS] - wished
            aside = aside if math.isfinite(sum(aside.tolist())) else _NO_DEVIATION
            state[at.DEVIATES] = float(aside.any())
            discrete_state.set_value(2, aside)
        discrete_state.set_value(0, state)
        if kinds:
            counts = context.get_discrete_state(1).value().copy()
            counts[kinds] += 1.0
            discrete_state.set_value(1, counts)


def _seen(state: np.ndarray, kinds: list[int], measurement: np.ndarray) -> tuple[list[int], float]:
    """The kinds with those that the camera adds, which the state notes, and the time of the last sample."""
    last_sample, refused, _ = measurement.tolist()
    if state[at.MODE] == at.HOLDING:
        kinds.append(_HELD)
    if refused > state[at.REFUSED_SEEN]:
        kinds.append(_REFUSED)
        state[at.REFUSED_SEEN] = refused
    return kinds, last_sample


def _take_from(state: np.ndarray, joints: JointSample) -> None:
    """Puts the state where the joints are, at rest."""
    if state[at.MODE] in (at.GOING, at.HOLDING):
        state[at.ASIDE] = 0.0
    if not math.isnan(state[0]):
        state[at.ASIDE] += joints.position - state[at.WERE_AT]
    state[at.POSITIONS], state[at.VELOCITIES] = joints.position, 0.0
    state[at.TURNING], state[at.SPEEDING] = 0.0, 0.0
    state[at.BEFORE] = state[at.WERE_AT] = joints.position
