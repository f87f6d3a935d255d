"""Supervision of the commands: limits, missing commands, lost measurements and the smooth stop."""

import math
from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from robots.configuration.quantity import quantity
from robots.description.model import NUM_JOINTS, RobotModel
from systems.samples import JointSample

KINDS = (
    "velocity_limit",  # a joint would have moved faster than it may; all joints are slowed alike
    "position_limit",  # a joint would have left its range
    "correction_limit",  # the law's correction stands at its limit
    "no_command",  # the law gave no finite command; the last one is held
    "measurement_refused",  # a sample too far from the path to be true
    "measurement_held",  # no usable sample for a while; the law holds its correction
    "stopped",  # no usable sample or no command for too long, or the robot does not run; it is at rest
    "resumed",  # the robot is led from rest back to the law's command
)
_VELOCITY, _POSITION, _CORRECTION, _NO_COMMAND, _REFUSED, _HELD, _STOPPED, _RESUMED = range(len(KINDS))

# The state beside the counts: what was issued last (NaN before the first command), the velocity from which
# a braking began, the mode, the times of the first tick and of the last command, the refused samples seen,
# and the way back after a stop: how long it is in s, how much of it is done, where it began as seen from the
# law's command, position and velocity, and where it is now; and where the joints were at the last tick.
_POSITIONS, _VELOCITIES, _ISSUED, _BRAKING_FROM = slice(0, 6), slice(6, 12), slice(0, 12), slice(12, 18)
_MODE, _FIRST_TICK, _LAST_COMMAND, _REFUSED_SEEN, _WAY, _DONE = range(18, 24)
_OFFSET, _OFFSET_RATE, _ASIDE, _WERE_AT = slice(24, 30), slice(30, 36), slice(36, 42), slice(42, 48)
_WIDTH = 48
_GOING, _HOLDING, _STOPPING, _RESUMING, _IDLE = 0.0, 1.0, 2.0, 3.0, 4.0
_RESUME_SPEED = 0.25  # share of the largest joint speed that the way back may add
_NO_DEVIATION = np.zeros(NUM_JOINTS)


@dataclass
class GuardConfig:
    """Limits and time-outs of the guard; read from a scenario file."""

    # Without a usable sample: the correction is held, the path goes on
    hold_after: float = quantity(0.05, 1e-3, 10.0, "s")
    stop_after: float = quantity(0.5, 1e-3, 60.0, "s")  # without a usable sample or command: smooth stop
    stop_time: float = quantity(0.25, 1e-3, 10.0, "s")  # from full motion to rest
    resume: bool = False  # whether to go on when what caused a stop is over
    resume_time: float = quantity(1.0, 1e-3, 60.0, "s")  # at least, from rest back to the law's command
    speed_share: float = quantity(1.0, 0.0, 1.0, is_open=True)  # of the robot's largest joint speeds
    # From the path: a sample further away is taken for a false detection
    largest_deviation: float = quantity(0.2, 1e-4, 2.0, "m")
    largest_deviation_deg: float = quantity(40.0, 0.01, 180.0, "deg")


class CommandGuard(LeafSystem):
    """Passes a law's command on, made safe.

    Ports:
        in  ``position_command``  vector 6 in rad, NaN where the law finds no solution
        in  ``velocity_command``  vector 6 in rad/s
        in  ``correction``        vector 6 in rad and m, rotation first
        in  ``measurement``       vector 3: when the last usable sample arrived (s), how many were refused,
                                  when the newest one was exposed (s)
        in  ``joint_sample``      JointSample
        out ``position_command``  vector 6 in rad: always finite, in range, within the speed limits
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
    measured position; when it runs again it is led smoothly from there to what the law commands then.
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
        self._lower, self._upper = robot.lower, robot.upper
        self._speed = speed = config.speed_share * robot.speed
        # Of each joint: its range, its largest speed, its largest step in a tick.
        self._limits = list(
            zip(*(a.tolist() for a in (robot.lower, robot.upper, speed, period * speed)), strict=True)
        )
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
        follows = not {_NO_COMMAND, _STOPPED, _VELOCITY, _POSITION}.intersection(kinds)
        output.set_value(torque if follows and np.isfinite(torque).all() else np.zeros(NUM_JOINTS))

    def _calc_next(self, context: Context, value) -> None:
        """The next state, which kinds of intervention it takes, and when the last sample arrived."""
        joints: JointSample = self._joints.Eval(context)
        has_issued = not math.isnan(context.get_discrete_state(0).value()[0])
        if not (joints.running and has_issued):
            value.set_value(self._decided(context, joints))
            return
        state, kinds, last_sample = self._next_in_motion.Eval(context)
        state = state.copy()
        state[_WERE_AT] = joints.position
        value.set_value((state, kinds, last_sample))

    def _calc_next_in_motion(self, context: Context, value) -> None:
        value.set_value(self._decided(context, None))

    def _decided(self, context: Context, joints: JointSample | None) -> tuple[np.ndarray, list[int], float]:
        """What `_calc_next` says; no joints stand for a robot that runs and has been commanded before."""
        state = context.get_discrete_state(0).value().copy()
        position, velocity, correction, measurement = (port.Eval(context).tolist() for port in self._inputs)
        kinds = []
        if joints is not None:
            if state[_MODE] in (_GOING, _HOLDING):
                state[_ASIDE] = 0.0
            if not math.isnan(state[0]):
                state[_ASIDE] += joints.position - state[_WERE_AT]
            state[_POSITIONS], state[_VELOCITIES] = joints.position, 0.0
            state[_WERE_AT] = joints.position
        if joints is not None and not joints.running and state[_LAST_COMMAND] > -math.inf:
            kinds.append(_STOPPED)
            state[_BRAKING_FROM] = 0.0
            state[_MODE] = _IDLE
        elif state[_MODE] == _STOPPING:
            kinds.append(_STOPPED)
            self._brake(state)
            if math.isfinite(sum(velocity)):
                state[_ASIDE] += self._period * (state[_VELOCITIES] - velocity)
        elif not math.isfinite(sum(position) + sum(velocity)):
            # Before the first command a law is silent by right.
            if state[_LAST_COMMAND] > -math.inf:
                kinds.append(_NO_COMMAND)
            self._brake(state)
        else:
            if state[_MODE] in (_IDLE, _RESUMING):
                kinds.append(_RESUMED)
                position, velocity = self.blend_back(state, position, velocity)
            self._follow(state, position, velocity, kinds)
        if state[_MODE] == _HOLDING:
            kinds.append(_HELD)
        refused = measurement[1]
        if refused > state[_REFUSED_SEEN]:
            kinds.append(_REFUSED)
            state[_REFUSED_SEEN] = refused
        a, b, c, x, y, z = correction
        if (
            a * a + b * b + c * c > self._correction_angle**2
            or x * x + y * y + z * z > self._correction_limit**2
        ):
            kinds.append(_CORRECTION)
        return state, kinds, measurement[0]

    def _follow(
        self, state: np.ndarray, position: list[float], velocity: list[float], kinds: list[int]
    ) -> None:
        """Goes to the law's command as far as the limits allow. Plain floats: this runs every tick."""
        start = state[_POSITIONS].tolist()
        if all(
            lower <= wanted <= upper and abs(rate) <= speed and abs(wanted - last) <= stride
            for wanted, rate, last, (lower, upper, speed, stride) in zip(
                position, velocity, start, self._limits, strict=True
            )
        ):
            state[_ISSUED], state[_BRAKING_FROM] = position + velocity, velocity
            return
        steps, rates = [], []
        excess, is_outside = 0.0, False
        for wanted, rate, last, (lower, upper, speed, stride) in zip(
            position, velocity, start, self._limits, strict=True
        ):
            # Into the range first: the way to where a joint must not go is not to slow the others down.
            if wanted < lower or wanted > upper:
                is_outside = True
                if (wanted > upper) == (rate > 0.0):
                    rate = 0.0
                wanted = lower if wanted < lower else upper
            step = wanted - last
            excess = max(excess, abs(rate) / speed, abs(step) / stride)
            steps.append(step)
            rates.append(rate)
        if is_outside:
            kinds.append(_POSITION)
        if excess > 1.0 + 1e-9:
            kinds.append(_VELOCITY)
            steps, rates = [step / excess for step in steps], [rate / excess for rate in rates]
        state[_ISSUED] = [last + step for last, step in zip(start, steps, strict=True)] + rates
        state[_BRAKING_FROM] = rates

    def blend_back(
        self, state: np.ndarray, position: list[float], velocity: list[float]
    ) -> tuple[list[float], list[float]]:
        """The law's command and what is left of the distance to it, a polynomial of fifth degree in time."""
        law_position, law_velocity = np.array(position), np.array(velocity)
        if state[_MODE] == _IDLE:
            # As it was a tick ago, when the robot was where it is.
            offset = state[_POSITIONS] - (law_position - self._period * law_velocity)
            if self._is_speed_only:
                offset = state[_ASIDE].copy()
            state[_OFFSET], state[_OFFSET_RATE] = offset, -law_velocity
            # The steepest part of the polynomial is 1.875 times its mean slope.
            longest = float(np.max(1.875 * np.abs(offset) / (_RESUME_SPEED * self._speed)))
            state[_WAY], state[_DONE], state[_MODE] = max(self._config.resume_time, longest), 0.0, _RESUMING
        state[_DONE] = min(1.0, state[_DONE] + self._period / state[_WAY])
        s, T = state[_DONE], state[_WAY]
        offset, rate = state[_OFFSET], state[_OFFSET_RATE]
        left = 1.0 - s**3 * (10.0 - s * (15.0 - 6.0 * s))
        drift = T * s * (1.0 - s**2 * (6.0 - s * (8.0 - 3.0 * s)))
        left_rate = -30.0 * (s * (1.0 - s)) ** 2 / T
        drift_rate = 1.0 - s**2 * (18.0 - s * (32.0 - 15.0 * s))
        if s >= 1.0:
            state[_MODE] = _GOING
        state[_ASIDE] = left * offset + drift * rate
        velocity = (law_velocity + left_rate * offset + drift_rate * rate).tolist()
        return position if self._is_speed_only else (law_position + state[_ASIDE]).tolist(), velocity

    def _brake(self, state: np.ndarray) -> None:
        """Slows all joints down evenly, from full motion to rest in ``stop_time``."""
        start, last = state[_BRAKING_FROM], state[_VELOCITIES].copy()
        top = float(np.abs(start).max())
        share = (
            max(0.0, float(np.abs(last).max()) / top - self._period / self._config.stop_time) if top else 0.0
        )
        velocity = share * start
        position = state[_POSITIONS] + 0.5 * self._period * (last + velocity)
        state[_POSITIONS] = np.minimum(np.maximum(position, self._lower), self._upper)
        state[_VELOCITIES] = velocity

    def _remember(self, context: Context, discrete_state: DiscreteValues) -> None:
        """Makes the issued command the state and decides from the clocks how the next tick will go."""
        state, kinds, last_sample = self._next.Eval(context)
        state = state.copy()
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
        elif state[_MODE] not in (_IDLE, _RESUMING):
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
