"""The system that decides how fast the robot may go while people are near. An aid, not a safety function."""

import importlib
from collections.abc import Callable

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.arm_capsules import ArmCapsules
from systems.guard.separation.protective_distance import (
    ProtectiveDistance,
    ReactionTime,
    SeparationConfig,
    largest_share,
    protective_distance,
    stopping_time,
)
from systems.sampled_system import SampledSystem
from systems.samples import JointSample, PersonSample

ZONES = ("free", "slow", "stop")
STATUS = ("distance", "protective_distance", "zone", "age")  # of the output ``separation``; m, m, index, s
_FREE, _SLOW, _STOP = 0.0, 1.0, 2.0
_SHARE, _STOPPED, _TRUSTED, _STATUS, _FULL, _ALONG = 0, 1, 2, slice(3, 7), slice(7, 13), slice(13, 19)
_WIDTH = 19
_STEP = 1e-4  # s, over which speeds of the arm are told from differences
_LEAST_RATE = 0.2  # below which the full speed of the path is not told from the commands
_FORGET = 0.02  # of the largest full speed per decision
_GRADES = 20  # of the share that is put out
FAR = 1e3  # m, where nobody is


class SeparationMonitor(SampledSystem):
    """Compares the distance of the nearest person with the protective one of ISO/TS 15066.

    Ports:
        in  ``person_sample``     PersonSample
        in  ``joint_sample``      JointSample
        in  ``velocity_command``  vector 6 in rad/s
        in  ``path_time``         vector 2: the time on the path in s and its rate
        in  ``acknowledge``       vector 1, optional: above 0.5 somebody lets the robot go on after a stop
        out ``speed_share``       vector 1: how fast the path may be run, 1 as planned, 0 at rest
        out ``stop``              vector 1: 1 from a stop until it is over, else 0
        out ``separation``        vector of `STATUS`

    Three zones: *free* where the distance suffices at full speed, *slow* where it suffices at a share of it,
    *stop* where it does not suffice for a robot at rest or where no trusted images have come for too long.
    """

    def __init__(
        self,
        robot: RobotModel,
        arm: ArmCapsules,
        config: SeparationConfig,
        reaction: ReactionTime,
        stop_time: float,
        path_speed: float = 0.0,
        tick: float | None = None,
    ) -> None:
        """Makes the system.

        Args:
            robot: whose accelerations count.
            arm: its capsules with what it carries.
            config: distances and times.
            reaction: T_r of the chain that this system is in.
            stop_time: s in which a path comes to rest that is run at full speed.
            path_speed: the largest of the tool on its path in m/s; the arm is not taken for slower.
            tick: s, of a control cycle whose systems are all updated at once; it then decides in every so
                many of them as come nearest to the period of its decisions. None for that period alone.

        Raises:
            ValueError: if it would stop before it slows, a fresh image would count as late, or the time to
                rest is not positive.
        """
        super().__init__()
        if not config.slow_after < config.stop_after:
            raise ValueError(
                f"separation: slow_after={config.slow_after:g} s must be below "
                f"stop_after={config.stop_after:g} s"
            )
        usual = reaction.images + reaction.transport + reaction.computation
        if not usual < config.slow_after:
            raise ValueError(
                f"separation: slow_after={config.slow_after:g} s must be above the {usual:g} s that images "
                "are old at most when all is well"
            )
        if not stop_time > 0.0:
            raise ValueError(f"separation: the time to rest must be positive, got {stop_time} s")
        # With numba, which takes time to be imported.
        self._nearest = importlib.import_module("systems.guard.separation.kernels").nearest
        self._nearest(np.zeros((1, 3)), np.zeros((1, 3)), np.ones((1, 3)), np.ones(1))
        self._arm, self._config, self._reaction = arm, config, reaction
        self._tick = tick or config.period
        self._every = max(1, round(config.period / self._tick))
        self._stop_time, self._path_speed = stop_time, path_speed
        self._acceleration = robot.acceleration
        self._people = self.DeclareAbstractInputPort("person_sample", Value[object](PersonSample()))
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        self._velocity = self.DeclareVectorInputPort("velocity_command", NUM_JOINTS)
        self._path_time = self.DeclareVectorInputPort("path_time", 2)
        self._acknowledge = self.DeclareVectorInputPort("acknowledge", 1)
        start = np.zeros(_WIDTH)
        start[[_SHARE, _TRUSTED]] = 0.0, -np.inf
        self._state = self.DeclareDiscreteState(start)
        parts = {"speed_share": slice(_SHARE, _SHARE + 1), "stop": slice(_STOPPED, _STOPPED + 1)}
        for name, part in {**parts, "separation": _STATUS}.items():
            size = part.stop - part.start
            self.DeclareVectorOutputPort(name, size, self._shown(part), {self.xd_ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(self._tick, 0.0, self._decide)

    def _shown(self, part: slice) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            value = context.get_discrete_state(self._state).value()[part]
            # Rounded down: a share that changes with every decision would be many changes of the path time.
            is_share = part.start == _SHARE
            output.set_value(np.floor(_GRADES * value + 1e-9) / _GRADES if is_share else value)

        return calc

    def terms(
        self, velocity: np.ndarray, q: np.ndarray, human_speed: float = 0.0, along: np.ndarray | None = None
    ) -> ProtectiveDistance:
        """The protective distance at joint speeds (6,) in rad/s and positions (6,) in rad.

        Of speeds without signs joints that turn against each other seem to be slower together than they are:
        ``along`` are the same with signs, rad/s, (6,), and the faster of both counts.
        """
        now = self._arm.at(q)
        speed = self._path_speed
        for each in (velocity, velocity if along is None else along):
            later = self._arm.at(q + _STEP * each)
            ends = np.concatenate([later.start - now.start, later.end - now.end])
            speed = max(speed, float(np.linalg.norm(ends, axis=1).max()) / _STEP)
        stop = stopping_time(self._stop_time, velocity, self._acceleration)
        fastest = max(self._config.human_speed, human_speed)
        return protective_distance(self._config, self._reaction, speed, stop, fastest)

    def _decide(self, context: Context, discrete_state: DiscreteValues) -> None:
        if round(context.get_time() / self._tick) % self._every:
            return
        state = context.get_discrete_state(self._state).value().copy()
        sample, joints = self._people.Eval(context), self._joints.Eval(context)
        time, config = context.get_time(), self._config
        if sample.trusted:
            state[_TRUSTED] = max(state[_TRUSTED], sample.time)
        age = time - state[_TRUSTED]
        rate = float(self._path_time.Eval(context)[1])
        velocity = np.nan_to_num(self._velocity.Eval(context))
        full, along = self._full_speed(state, velocity, rate)
        arm = self._arm.at(joints.position)
        distance = min(
            (
                self._nearest(each.points, arm.start, arm.end, arm.radius) - each.reach
                for each in sample.people
            ),
            default=FAR,
        )
        walking = max((float(np.linalg.norm(each.velocity)) for each in sample.people), default=0.0)
        terms = self.terms(full, joints.position, walking, along)
        allowed = min(largest_share(distance, terms), self._by_age(age))
        needed = terms.at_rest
        if state[_STOPPED]:
            needed += config.clearance
            is_clear = distance > needed and age < config.slow_after
            if is_clear and (not config.acknowledge or self._is_acknowledged(context)):
                state[_STOPPED] = 0.0
        elif time > config.stop_after or distance < FAR:  # nobody was there before the first images
            state[_STOPPED] = float(distance < needed or age >= config.stop_after)
        share = min(allowed, state[_SHARE] + config.rise * self._every * self._tick)
        state[_SHARE] = 0.0 if state[_STOPPED] else share
        state[_FULL], state[_ALONG] = full, along
        zone = _STOP if state[_STOPPED] else (_SLOW if allowed < 1.0 else _FREE)
        state[_STATUS] = distance, terms.total, zone, min(age, FAR)
        discrete_state.set_value(self._state, state)

    def _full_speed(
        self, state: np.ndarray, velocity: np.ndarray, rate: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The joint speeds that the path has at full speed, as commands at another one tell, rad/s.

        Returns:
            How large they have lately been at most, (6,), and what they were last, with signs, (6,).
        """
        if rate < _LEAST_RATE:
            return state[_FULL], state[_ALONG]
        along = velocity / rate
        return np.maximum(np.abs(along), (1.0 - _FORGET) * state[_FULL]), along

    def _by_age(self, age: float) -> float:
        """The share that images of an age in s allow."""
        span = self._config.stop_after - self._config.slow_after
        return float(np.clip((self._config.stop_after - age) / span, 0.0, 1.0))

    def _is_acknowledged(self, context: Context) -> bool:
        port = self._acknowledge
        return bool(port.HasValue(context) and port.Eval(context)[0] > 0.5)
