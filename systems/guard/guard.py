"""Supervision of the commands: limits, missing commands, lost measurements and the smooth stop."""

import importlib
import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.forward import Kinematics, robust_solve
from systems.guard.config import KINDS, GuardConfig
from systems.guard.jerk_limits import JerkLimits
from systems.guard.joint_limits import JointLimits
from systems.guard.way_back import shortest_way, way_left
from systems.samples import JointSample

_VELOCITY, _ACCELERATION, _POSITION, _CORRECTION, _NO_COMMAND, _REFUSED, _HELD, _STOPPED, _RESUMED = range(
    len(KINDS)
)

# The state beside the counts: what was issued last (NaN before the first command), the velocity from which
# a braking began, the mode, the times of the first tick and of the last command, the refused samples seen,
# and the way back after a stop: how long it is in s, how much of it is done, where it began as seen from the
# law's command, position and velocity, and where it is now; where the joints were at the last tick; what
# was issued before the last; and the accelerations with which position and velocity came to what was issued.
_POSITIONS, _VELOCITIES, _ISSUED, _BRAKING_FROM = slice(0, 6), slice(6, 12), slice(0, 12), slice(12, 18)
_MODE, _FIRST_TICK, _LAST_COMMAND, _REFUSED_SEEN, _WAY, _DONE = range(18, 24)
_OFFSET, _OFFSET_RATE, _ASIDE, _WERE_AT = slice(24, 30), slice(30, 36), slice(36, 42), slice(42, 48)
_BEFORE = slice(48, 54)
_TURNING, _SPEEDING = slice(54, 60), slice(60, 66)
_WIDTH = 66
_GOING, _HOLDING, _STOPPING, _RESUMING, _IDLE, _AWAY = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0
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
        unknown = np.zeros(_WIDTH)
        unknown[_ISSUED], unknown[_FIRST_TICK], unknown[_LAST_COMMAND] = np.nan, np.inf, -np.inf
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
        for name, part in (("position_command", _POSITIONS), ("velocity_command", _VELOCITIES)):
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
        state = context.get_discrete_state(0).value().copy()
        position, velocity, correction, measurement = (port.Eval(context) for port in self._inputs)
        kinds = []
        if joints is not None:
            _take_from(state, joints)
        if not are_joints_known:
            kinds.append(_REFUSED)
            position, state[_VELOCITIES] = _UNKNOWN, np.nan_to_num(state[_VELOCITIES])
        last = state.copy() if self._jerk.is_given else None
        excess = self._kernels.excess(correction, self._correction_angle, self._correction_limit)
        if excess > 0.0:
            kinds.append(_CORRECTION)
            if excess > _GRACE and self._config.on_correction_limit == "stop":
                state[_MODE] = _STOPPING
            elif excess > _GRACE:
                position, velocity = self._within_correction(position, velocity, correction)
        if joints is not None and not joints.running and state[_LAST_COMMAND] > -math.inf:
            kinds.append(_STOPPED)
            state[_BRAKING_FROM] = 0.0
            state[_MODE] = _IDLE
        elif state[_MODE] == _STOPPING:
            kinds.append(_STOPPED)
            self._brake(state)
            if self._kernels.is_command(_NO_DEVIATION, velocity, _ABSURD):
                state[_ASIDE] += self._period * (state[_VELOCITIES] - velocity)
        elif not self._kernels.is_command(position, velocity, _ABSURD):
            # Before the first command a law is silent by right.
            if state[_LAST_COMMAND] > -math.inf:
                kinds.append(_NO_COMMAND)
            self._brake(state)
        else:
            if state[_MODE] in (_IDLE, _RESUMING) or (
                state[_MODE] == _AWAY and not self._may_follow(state, position, velocity)
            ):
                kinds.append(_RESUMED)
                position, velocity = self._back(state, position, velocity)
            self._follow(state, position, velocity, kinds)
        if last is not None:
            self._ease(state, last, kinds)
        if state[_MODE] == _HOLDING:
            kinds.append(_HELD)
        last_sample, refused, _ = measurement.tolist()
        if refused > state[_REFUSED_SEEN]:
            kinds.append(_REFUSED)
            state[_REFUSED_SEEN] = refused
        return state, kinds, last_sample

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
            return state[_POSITIONS], state[_BEFORE]
        # Such a law commands from where the robot is, which what was issued before does not tell.
        now = position - self._period * velocity
        return now, now - self._period * state[_VELOCITIES]

    def _may_follow(self, state: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> bool:
        start, before = self._places(state, position, velocity)
        return self._kernels.is_allowed(self._rows, position, velocity, start, before, state[_VELOCITIES])

    def _follow(
        self, state: np.ndarray, position: np.ndarray, velocity: np.ndarray, kinds: list[int]
    ) -> None:
        """Goes to the law's command as far as the limits allow."""
        if self._may_follow(state, position, velocity):
            state[_BEFORE] = state[_POSITIONS]
            state[_POSITIONS], state[_VELOCITIES] = position, velocity
            state[_BRAKING_FROM] = velocity
            return
        limits, period = self._limits, self._period
        start, before = self._places(state, position, velocity)
        goal, rate = position, velocity
        excess = max(1.0, float((np.abs(rate) / limits.speed).max()))
        if self._jerk.is_given:  # which finds the way there itself, within all limits
            kinds += [_POSITION] if ((goal < limits.lower) | (goal > limits.upper)).any() else []
            kinds += [_VELOCITY] if excess > 1.0 else []
            state[_BEFORE], state[_VELOCITIES] = state[_POSITIONS], rate / excess
            state[_POSITIONS] = np.minimum(np.maximum(goal, limits.lower), limits.upper)
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
        last = state[_VELOCITIES]
        rate = np.where(has_arrived, rate / excess, mean)
        state[_BEFORE] = state[_POSITIONS]
        state[_POSITIONS] = issued
        state[_VELOCITIES] = np.minimum(np.maximum(rate, last - change), last + change)
        state[_BRAKING_FROM] = state[_VELOCITIES]

    def _ease(self, state: np.ndarray, last: np.ndarray, kinds: list[int]) -> None:
        """Keeps the jerk of what has been decided, ``last`` being the state before, in place."""
        if math.isnan(last[0]) or math.isnan(last[_BEFORE][0]):
            return
        period, is_braking = self._period, not {_STOPPED, _NO_COMMAND}.isdisjoint(kinds)
        position, goal, rate, both = last[_POSITIONS], state[_POSITIONS], state[_VELOCITIES], (period, period)
        was, speeding = last[_VELOCITIES], last[_SPEEDING]
        velocity = (self._jerk.braked if is_braking else self._jerk.eased)(was, speeding, rate, both)
        if not self._is_speed_only:
            speed, turning = (position - last[_BEFORE]) / period, last[_TURNING]
            if is_braking:
                mean = self._jerk.eased(speed, turning, 0.5 * (was + velocity), both, position)
            else:
                mean = self._jerk.followed(position, speed, turning, goal, rate, both)
            if is_braking or not np.array_equal(mean, (goal - position) / period):
                state[_POSITIONS] = self._limits.moved(position, mean, period)
                kinds += [] if is_braking else [_ACCELERATION]
            state[_TURNING] = (mean - speed) / period
        state[_VELOCITIES], state[_SPEEDING] = velocity, (velocity - was) / period
        if not is_braking:
            state[_BRAKING_FROM] = velocity

    def _back(
        self, state: np.ndarray, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The law's command and what is left of the distance to it after a stop or a silence."""
        if state[_MODE] != _RESUMING:
            # As it was a tick ago, when the robot was where it is.
            offset = state[_POSITIONS] - (position - self._period * velocity)
            if self._is_speed_only:
                offset = state[_ASIDE].copy()
            rate = state[_VELOCITIES] - velocity
            state[_OFFSET], state[_OFFSET_RATE] = offset, rate
            state[_WAY] = max(self._config.resume_time, shortest_way(self._limits, offset, rate))
            state[_DONE], state[_MODE] = 0.0, _RESUMING
        state[_DONE] = min(1.0, state[_DONE] + self._period / state[_WAY])
        left, left_rate = way_left(state[_DONE], state[_WAY], state[_OFFSET], state[_OFFSET_RATE])
        if state[_DONE] >= 1.0:
            state[_MODE] = _GOING
        state[_ASIDE] = left
        return position if self._is_speed_only else position + left, velocity + left_rate

    def _brake(self, state: np.ndarray) -> None:
        """Slows all joints down evenly, from full motion to rest in ``stop_time``, or as fast as they may."""
        limits, period = self._limits, self._period
        start, last, position = state[_BRAKING_FROM], state[_VELOCITIES].copy(), state[_POSITIONS].copy()
        top = float(np.abs(start).max())
        share = 0.0
        if top > 0.0:
            hardest = float((limits.acceleration / np.maximum(np.abs(start), 1e-12)).min())
            less = period * min(1.0 / self._config.stop_time, hardest)
            share = max(0.0, float(np.abs(last).max()) / top - less)
        mean = (position - state[_BEFORE]) / period
        if math.isnan(mean[0]):
            return
        velocity = limits.bounded(position, last, share * start, period, period)
        step = 0.5 * (last + velocity)
        if not self._is_speed_only:  # whose positions are not followed, and may have been anywhere
            step = limits.bounded(position, mean, step, period, period)
        state[_BEFORE], state[_POSITIONS] = position, limits.moved(position, step, period)
        state[_VELOCITIES] = velocity

    def hear(self, context: Context) -> None:
        """Takes note of where the joints were at the last tick, which was done before that was known."""
        joints: JointSample = self._joints.Eval(context)
        context.get_mutable_discrete_state(0).get_mutable_value()[_WERE_AT] = joints.position

    def _remember(self, context: Context, discrete_state: DiscreteValues) -> None:
        """Makes the issued command the state and decides from the clocks how the next tick will go."""
        state, kinds, last_sample, were_at = self._next.Eval(context)
        state = state.copy()
        if were_at is not None:
            state[_WERE_AT] = were_at
        time = context.get_time()
        if _NO_COMMAND not in kinds:
            state[_LAST_COMMAND] = time
        # A camera that has not spoken yet is not lost: its time starts with the guard's first tick.
        state[_FIRST_TICK] = min(state[_FIRST_TICK], time)
        age = time - max(last_sample, state[_FIRST_TICK]) if self._uses_camera else 0.0
        silence = time - state[_LAST_COMMAND]
        is_fresh = max(age, silence) < self._config.hold_after
        if state[_MODE] == _STOPPING:
            if self._config.resume and is_fresh and not state[_VELOCITIES].any():
                state[_MODE] = _IDLE
        elif max(age, silence) >= self._config.stop_after - 1e-9:
            state[_MODE] = _STOPPING
        elif _NO_COMMAND in kinds:
            state[_MODE] = _AWAY
        elif state[_MODE] not in (_IDLE, _RESUMING, _AWAY):
            state[_MODE] = _HOLDING if age >= self._config.hold_after - 1e-9 else _GOING
        discrete_state.set_value(0, state)
        if kinds or any(context.get_discrete_state(2).value().tolist()):
            wished = self._inputs[0].Eval(context)
            aside = state[_ASIDE] if self._is_speed_only else state[_POSITIONS] - wished
            discrete_state.set_value(2, aside if math.isfinite(sum(aside.tolist())) else _NO_DEVIATION)
        if kinds:
            counts = context.get_discrete_state(1).value().copy()
            counts[kinds] += 1.0
            discrete_state.set_value(1, counts)


def _take_from(state: np.ndarray, joints: JointSample) -> None:
    """Puts the state where the joints are, at rest."""
    if state[_MODE] in (_GOING, _HOLDING):
        state[_ASIDE] = 0.0
    if not math.isnan(state[0]):
        state[_ASIDE] += joints.position - state[_WERE_AT]
    state[_POSITIONS], state[_VELOCITIES], state[_TURNING], state[_SPEEDING] = joints.position, 0.0, 0.0, 0.0
    state[_BEFORE] = state[_WERE_AT] = joints.position
