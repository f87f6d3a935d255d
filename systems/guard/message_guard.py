"""The last look at every message to a robot: what it changes, in the time that really passed."""

import importlib
import math

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.guard.jerk_limits import JerkLimits
from systems.guard.joint_limits import JointLimits

MOST_BRIDGED = 8  # periods; after a longer gap a robot may stand still, so no motion is owed to it
LONGEST_OWED = 0.25  # s by which messages may be late altogether, to be followed by as many that seem early
_NO_TIME = 1e-5  # s, in which nothing may change
_SLACK = 1.0 + 1e-6


class PassedTime:
    """The time from message to message: what the sender's stamps say, but never more than has passed here.

    Messages come early and late, and after a silence often many at once. What they are late by is left to
    those that come early after them, up to `LONGEST_OWED`; in sum the time since the first message is never
    ahead of the own clock. A stamp that is not later than the newest one is of a message that was overtaken,
    or of a clock that was set back: it counts from the stamp before it, and what it was given is taken from
    the next one that is later. After `LONGEST_OWED` of such stamps the clock was set, and goes on from there.
    """

    def __init__(self, period: float) -> None:
        """Starts with the time of one message, ``period`` in s."""
        self._period, self._most, self._credit = period, MOST_BRIDGED * period, 0.0
        self._newest: float | None = None
        self._behind_since: float | None = None  # on the own clock, when the first stamp was not the newest
        self._last = self._aside = self._now = self._advanced = 0.0

    def until(self, stamp: float, now: float) -> float:
        """The time in s since the last call.

        Args:
            stamp: of the message on the sender's clock in s.
            now: the own clock in s.
        """
        if self._newest is None:
            self._newest = self._last = stamp
            self._now = self._advanced = now
            return self._period
        self._credit = min(self._credit + max(0.0, now - self._now), LONGEST_OWED)
        self._now = max(now, self._now)
        ahead, is_newest = stamp - self._last, stamp > self._newest
        if is_newest:
            passed = stamp - self._newest - self._aside
        elif ahead or now - self._advanced <= self._most:
            passed = ahead
        else:  # what stands for so long is no clock
            passed = self._period
        passed = min(max(0.0, passed), self._most, self._credit)
        self._aside = 0.0 if is_newest else self._aside + passed
        self._newest, self._last = max(stamp, self._newest), stamp
        if is_newest:
            self._behind_since = None
        elif self._behind_since is None:
            self._behind_since = now
        elif now - self._behind_since > LONGEST_OWED:
            self._newest, self._aside, self._behind_since = stamp, 0.0, None
        if ahead > 0.0:
            self._advanced = now
        self._credit -= passed
        return passed


class MessageGuard:
    """Keeps what is sent to a robot within the joints' limits, from each message to the next.

    The guard of the servo does the same from tick to tick. Between the two lie a wire and a clock: messages
    are lost, and clocks are set. What was sent last is the only thing that the robot knows.
    """

    def __init__(self, limits: JointLimits, period: float, is_speed_only: bool) -> None:
        """Knows nothing that was sent.

        Args:
            limits: of the joints.
            period: between two messages in s.
            is_speed_only: whether the robot follows velocities alone.
        """
        self._limits, self._period, self._is_speed_only = limits, period, is_speed_only
        self._rows = np.stack((limits.lower, limits.upper, limits.speed, limits.acceleration), axis=1)
        # Not before a guard is made: it takes time to import.
        self._kernels = importlib.import_module("systems.guard.kernels")
        self._kernels.warm_up()
        self._jerk = JerkLimits(limits)
        self.interventions = 0
        self.forget(np.full(NUM_JOINTS, np.nan))

    def forget(self, position: np.ndarray) -> None:
        """The robot stands at a position, (6,) rad, whatever was sent before."""
        self._position, self._speed, self._velocity = position, np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
        self._turning = self._speeding = np.zeros(NUM_JOINTS)  # accelerations of position and velocity
        self._braking_from, self._span, self._owed = self._velocity, self._period, 0.0
        self._keep(0.0)

    def _keep(self, passed: float) -> None:
        state = self._position, self._speed, self._velocity, self._braking_from, self._span
        self._kept = (
            *state,
            self._turning,
            self._speeding,
            min(self._owed + passed, MOST_BRIDGED * self._period),
        )

    def take_back(self) -> None:
        """What was judged last has not been sent; its time is left to the next one."""
        self._position, self._speed, self._velocity, self._braking_from, self._span, *others = self._kept
        self._turning, self._speeding, self._owed = others

    @property
    def knows_nothing(self) -> bool:
        """Whether nothing has been sent, or said to be the place of the robot."""
        return bool(np.isnan(self._position[0]))

    @property
    def is_at_rest(self) -> bool:
        """Whether the last message was to stand still where the one before was."""
        return not (self._speed.any() or self._velocity.any())

    def judged(
        self, position: np.ndarray, velocity: np.ndarray, passed: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """What may be sent.

        Args:
            position: wanted, (6,) rad.
            velocity: wanted, (6,) rad/s.
            passed: time since the last message in s.

        Returns:
            The same if it is within the limits, or as near as they allow; NaN if nothing is known.
        """
        if not math.isfinite(sum(position.tolist()) + sum(velocity.tolist())):
            return self.braking(passed, self._period)
        self._keep(passed)
        passed += self._owed
        if self.knows_nothing:
            return position, velocity
        if passed < _NO_TIME:
            self._owed = passed
            return self._position, self._velocity
        limits, span = self._limits, 0.5 * (passed + self._span)
        start, speed = self._position, self._speed
        if self._is_speed_only:
            start, speed = position - passed * velocity, self._velocity
        mean = (position - start) / passed
        times = _SLACK * passed, _SLACK * span, _SLACK
        is_allowed = self._kernels.may_be_sent(
            self._rows, position, velocity, mean, speed, self._velocity, *times
        )
        if self._jerk.is_given:
            position, velocity, mean, is_same = self._eased(position, velocity, start, speed, passed)
            self.interventions += not (is_same and is_allowed)
        elif not is_allowed:
            self.interventions += 1
            change = _SLACK * passed * limits.acceleration
            velocity = np.minimum(np.maximum(velocity, -limits.speed), limits.speed)
            mean, _ = limits.step(start, speed, position, velocity, passed, span)
            issued = limits.moved(start, mean, passed)
            rate = np.where(np.abs(issued - position) < 1e-12, velocity, mean)
            position = issued
            velocity = np.minimum(np.maximum(rate, self._velocity - change), self._velocity + change)
        self._note(position, velocity, mean, passed)
        self._braking_from = velocity
        return position, velocity

    def _eased(
        self,
        position: np.ndarray,
        velocity: np.ndarray,
        start: np.ndarray,
        speed: np.ndarray,
        passed: float,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
        """Position and velocity within all limits, the mean speeds, and whether they are those wanted."""
        limits = self._limits
        goal = np.minimum(np.maximum(position, limits.lower), limits.upper)
        rate = np.minimum(np.maximum(velocity, -limits.speed), limits.speed)
        issued = self._jerk.eased(self._velocity, self._speeding, rate, (0.5 * (passed + self._span), passed))
        if self._is_speed_only:
            return position, issued, issued, np.array_equal(issued, velocity)
        times = self._span, passed
        mean = self._jerk.followed(start, speed, self._turning, goal, rate, times)
        is_same = np.array_equal(mean, (position - start) / passed)
        if not is_same:
            position = limits.moved(start, mean, passed)
        return position, issued, mean, is_same and np.array_equal(issued, velocity)

    def braking(self, passed: float, stop_time: float) -> tuple[np.ndarray, np.ndarray]:
        """What may be sent on the way to rest: all joints slow down evenly, or as fast as they may.

        Args:
            passed: time since the last message in s.
            stop_time: from the motion before to rest, in s.
        """
        self._keep(passed)
        passed += self._owed
        if self.knows_nothing or passed < _NO_TIME:
            self._owed = passed
            return self._position, self._velocity
        limits, start = self._limits, self._braking_from
        top = float(np.abs(start).max())
        share = 0.0
        if top > 0.0:
            hardest = float((limits.acceleration / np.maximum(np.abs(start), 1e-12)).min())
            less = passed * min(1.0 / max(stop_time, 1e-6), hardest)
            share = max(0.0, float(np.abs(self._velocity).max()) / top - less)
        span, velocity = 0.5 * (passed + self._span), share * start
        if self._jerk.is_given:
            velocity = self._jerk.braked(self._velocity, self._speeding, velocity, (span, passed))
        mean = 0.5 * (self._velocity + velocity)
        if not self._is_speed_only:
            mean = limits.bounded(self._position, self._speed, mean, passed, span)
            if self._jerk.is_given:
                times = self._span, span
                mean = self._jerk.eased(self._speed, self._turning, mean, times, self._position)
        self._note(limits.moved(self._position, mean, passed), velocity, mean, passed)
        return self._position, self._velocity

    def _note(self, position: np.ndarray, velocity: np.ndarray, mean: np.ndarray, passed: float) -> None:
        if self._jerk.is_given:
            self._turning = (mean - self._speed) / (0.5 * (passed + self._span))
            self._speeding = (velocity - self._velocity) / passed
        self._position, self._velocity, self._speed = position.copy(), velocity.copy(), mean
        self._span, self._owed = passed, 0.0
