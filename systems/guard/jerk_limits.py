"""The largest jerk of joints, where a robot file gives one: kept from command to command, also in a stop."""

import numpy as np
from ruckig import InputParameter, Result, Ruckig, RuckigError, Synchronization, Trajectory

from robots.description.model import NUM_JOINTS
from systems.guard.joint_limits import JointLimits, fastest

_SHARE = 0.9  # of the jerk that is planned with: a plan is continuous, and commands are steps
_SLOWEST_STOP = 0.05  # of its largest acceleration that a joint brakes with at least
_SHORTEST = (
    1e-3  # s from command to command, in which a joint without a limit may turn its acceleration round
)
_SLOWEST = 0.05  # of its largest speed, by which a joint may at least be faster than a goal that moves
_SAME = 1e-12  # rad/s


class JerkLimits:
    """The last word on speeds that keep all other limits.

    An acceleration is the change of a speed from one command to the next in the time between, and the jerk
    is that of the accelerations. So that a speed is not exceeded while an acceleration fades, an acceleration
    is allowed only as far as it can fade before; and so that a joint does not leave its range, it brakes as
    soon as it would otherwise not come to rest within.
    """

    def __init__(self, limits: JointLimits) -> None:
        """Takes the limits of all joints; one that has none turns its acceleration round in two periods."""
        self.is_given = bool(np.isfinite(limits.jerk).any())
        self._jerk = np.minimum(limits.jerk, 2.0 * limits.acceleration / _SHORTEST)
        self._limits = limits

    def followed(
        self,
        position: np.ndarray,
        speed: np.ndarray,
        turning: np.ndarray,
        goal: np.ndarray,
        rate: np.ndarray,
        times: tuple[float, float],
    ) -> np.ndarray:
        """The mean speeds (6,) in rad/s with which a command is followed: its own, if it may be as it is.

        Args:
            position: commanded last, (6,) rad.
            speed: mean speeds until then, (6,) rad/s.
            turning: the acceleration with which they were reached, (6,) rad/s^2.
            goal: the command, (6,) rad.
            rate: its speeds, (6,) rad/s.
            times: from the command before last to the last one and from there to this one, s.
        """
        before, period = times
        wanted, times = (goal - position) / period, (before, 0.5 * (before + period))
        found = self._changed(speed, turning, wanted, times, position)
        if np.array_equal(found, wanted):
            return found
        wanted = self._towards(position, speed, turning, goal, rate, period)
        return self._changed(speed, turning, wanted, times, position)

    def braked(
        self, velocity: np.ndarray, speeding: np.ndarray, wanted: np.ndarray, times: tuple[float, float]
    ) -> np.ndarray:
        """The velocities (6,) in rad/s of a step on the way to rest.

        Args:
            velocity: commanded last, (6,) rad/s.
            speeding: the acceleration with which it was reached, (6,) rad/s^2.
            wanted: what it would be without a limit of jerk, (6,) rad/s.
            times: as of `eased`.
        """
        most = np.maximum(np.abs(wanted - velocity) / times[1], _SLOWEST_STOP * self._limits.acceleration)
        return self._changed(velocity, speeding, np.zeros(NUM_JOINTS), times, most=most, stays=True)

    def _towards(
        self,
        position: np.ndarray,
        speed: np.ndarray,
        turning: np.ndarray,
        goal: np.ndarray,
        rate: np.ndarray,
        period: float,
    ) -> np.ndarray:
        """The mean speeds (6,) in rad/s of the shortest way to a goal that moves.

        Args:
            position: commanded last, (6,) rad.
            speed: mean speeds until then, (6,) rad/s.
            turning: the acceleration with which they were reached, (6,) rad/s^2.
            goal: where it is after the period, (6,) rad.
            rate: its speeds, (6,) rad/s.
            period: s.
        """
        # Made anew every time: what is kept until the interpreter ends is reported as a leak.
        plan, top, most = InputParameter(NUM_JOINTS), self._limits.speed, self._limits.acceleration
        plan.synchronization = Synchronization.Phase
        plan.max_acceleration, plan.max_jerk = most.tolist(), (_SHARE * self._jerk).tolist()
        plan.target_position = plan.target_velocity = [0.0] * NUM_JOINTS
        turning = np.minimum(np.maximum(turning, -most), most)
        # Speeds are those between two commands and their changes those at a command: known is all of the last
        # but one.
        off = position - period * speed + period**2 / 6.0 * turning - (goal - 2.0 * period * rate)
        plan.current_position = off.tolist()
        plan.current_velocity = (speed - 0.5 * period * turning - rate).tolist()
        plan.current_acceleration = turning.tolist()
        # As seen from the goal; a joint that is too fast already is slowed down first.
        plan.max_velocity = np.maximum(top - rate, _SLOWEST * top).tolist()
        plan.min_velocity = np.minimum(-top - rate, -_SLOWEST * top).tolist()
        trajectory = Trajectory(NUM_JOINTS)
        try:
            if Ruckig(NUM_JOINTS, period).calculate(plan, trajectory) not in (
                Result.Working,
                Result.Finished,
            ):
                return rate
        except RuckigError:  # of numbers that it cannot plan with
            return rate
        return speed + period * np.array(trajectory.at_time(period)[2])

    def eased(
        self,
        speed: np.ndarray,
        turning: np.ndarray,
        wanted: np.ndarray,
        times: tuple[float, float],
        position: np.ndarray | None = None,
    ) -> np.ndarray:
        """The allowed speeds (6,) in rad/s on the way to those that are wanted, joint by joint.

        Args:
            speed: before, (6,) rad/s.
            turning: the acceleration with which it was reached, (6,) rad/s^2.
            wanted: (6,) rad/s.
            times: from the acceleration before to this one, and from the speed before to this one, s.
            position: commanded last, (6,) rad; None where there are none, or they do not count.
        """
        at_once = self._changed(speed, turning, wanted, times, position)
        if np.array_equal(at_once, wanted):
            return wanted
        fading = self._changed(speed, turning, wanted, times, position, stays=True)
        return np.where(at_once == wanted, wanted, fading)

    def _changed(
        self,
        speed: np.ndarray,
        turning: np.ndarray,
        wanted: np.ndarray,
        times: tuple[float, float],
        position: np.ndarray | None = None,
        most: np.ndarray | None = None,
        stays: bool = False,
    ) -> np.ndarray:
        """The allowed speeds nearest to those that are wanted; arguments as of `eased`.

        ``most`` is the largest acceleration that is wanted, (6,) rad/s^2; ``stays`` means that the speeds
        that are wanted will not change, so that the acceleration has to fade on the way to them.
        """
        (_, span), limit = times, self._limits.acceleration
        most = limit if most is None else most
        found = self._turned(speed, turning, wanted, times, most, stays)
        if position is not None:
            leaves = self._leaves(position + found * span, found, (found - speed) / span, span)
            if leaves.any():
                braked = self._turned(speed, turning, np.zeros(NUM_JOINTS), times, limit, stays=True)
                found = np.where(leaves, braked, found)
        return np.where(np.abs(found - wanted) < _SAME, wanted, found)

    def _turned(
        self,
        speed: np.ndarray,
        turning: np.ndarray,
        wanted: np.ndarray,
        times: tuple[float, float],
        most: np.ndarray,
        stays: bool,
    ) -> np.ndarray:
        before, span = times
        limits, fade = self._limits, self._jerk * span
        gap = wanted - speed
        goal = np.sign(gap) * fastest(np.abs(gap), fade, span) if stays else gap / span
        up = np.minimum(most, fastest(limits.speed - speed, fade, span))
        down = np.minimum(most, fastest(limits.speed + speed, fade, span))
        goal = np.minimum(np.maximum(goal, -down), up)
        change = self._jerk * before
        goal = np.minimum(np.maximum(goal, turning - change), turning + change)
        # Not all can be kept where the time between two commands has changed: acceleration and speed are.
        found = speed + span * np.minimum(np.maximum(goal, -limits.acceleration), limits.acceleration)
        top = np.maximum(limits.speed, np.abs(speed))
        return np.minimum(np.maximum(found, -top), top)

    def _leaves(
        self, position: np.ndarray, speed: np.ndarray, turning: np.ndarray, period: float
    ) -> np.ndarray:
        """Which joints (6,) can not be trusted to come to rest within their range any more."""
        limits, jerk = self._limits, self._jerk
        most, way = limits.acceleration, np.sign(speed)
        outward = np.maximum(way * turning, 0.0)
        top = np.abs(speed) + outward**2 / (2.0 * jerk) + outward * period
        time = np.where(top > most**2 / jerk, top / most + most / jerk, 2.0 * np.sqrt(top / jerk))
        room = top * (0.5 * time + outward / jerk + 2.0 * period)
        left = np.where(way > 0.0, limits.upper - position, position - limits.lower)
        return (way != 0.0) & (room > left)
