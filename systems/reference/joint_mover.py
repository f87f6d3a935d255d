"""Moves joints from where they are to a goal, smoothly, and stays there."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context

from robots.description.model import NUM_JOINTS
from systems.sampled_system import SampledSystem

_START, _GOAL, _BEGIN, _DURATION = slice(0, 6), slice(6, 12), 12, 13
# The largest slope of the polynomial 10 s^3 - 15 s^4 + 6 s^5.
_PEAK = 1.875


class JointMover(SampledSystem):
    """Plays a motion of all joints at once along a polynomial of fifth degree, at rest at both ends.

    Ports:
        out ``position_command``  vector 6 in rad
        out ``velocity_command``  vector 6 in rad/s

    Until it is told where it is, it stands at zero.
    """

    def __init__(self, speed: np.ndarray, shortest: float = 0.2) -> None:
        """Declares the ports.

        Args:
            speed: largest joint speeds in rad/s, shape (6,).
            shortest: least duration of a motion in s.

        Raises:
            ValueError: if a speed or the duration is not positive.
        """
        super().__init__()
        if not (np.min(speed) > 0.0 and shortest > 0.0):
            raise ValueError(
                f"joint mover: speeds and duration must be positive, got {speed} rad/s and {shortest} s"
            )
        self._speed, self._shortest = speed, shortest
        state = self.DeclareDiscreteState(np.append(np.zeros(_DURATION), shortest))
        prerequisites = {self.time_ticket(), self.discrete_state_ticket(state)}
        for order, name in enumerate(("position_command", "velocity_command")):
            self.DeclareVectorOutputPort(name, NUM_JOINTS, self._calc(order), prerequisites)

    def set_at_rest(self, context: Context, q: np.ndarray) -> None:
        """Stands still at joint positions in rad, shape (6,)."""
        context.SetDiscreteState(0, np.concatenate([q, q, [0.0, self._shortest]]))

    def go(self, context: Context, goal: np.ndarray) -> float:
        """Begins a motion to joint positions in rad, shape (6,); returns the time in s at which it ends."""
        start, begin = self._along(context, 0), context.get_time()
        duration = _duration(start, goal, self._speed, self._shortest)
        context.SetDiscreteState(0, np.concatenate([start, goal, [begin, duration]]))
        return begin + duration

    def _along(self, context: Context, order: int) -> np.ndarray:
        state = context.get_discrete_state(0).value()
        passed = context.get_time() - state[_BEGIN]
        return _polynomial(state[_START], state[_GOAL], passed, state[_DURATION])[order]

    def _calc(self, order: int):
        def calc(context: Context, output: BasicVector) -> None:
            output.set_value(self._along(context, order))

        return calc


def smooth_motion(
    start: np.ndarray, goal: np.ndarray, passed: float, speed: np.ndarray, shortest: float = 0.2
) -> tuple[np.ndarray, np.ndarray, float]:
    """The same motion as a function: positions in rad, velocities in rad/s, and the time left in s.

    Args:
        start: where the joints are at rest, in rad, shape (6,).
        goal: where they shall be.
        passed: time since the start in s.
        speed: largest joint speeds in rad/s, shape (6,).
        shortest: least duration in s.
    """
    duration = _duration(start, goal, speed, shortest)
    return *_polynomial(start, goal, passed, duration), duration - passed


def _duration(start: np.ndarray, goal: np.ndarray, speed: np.ndarray, shortest: float) -> float:
    return max(shortest, _PEAK * float(np.max(np.abs(goal - start) / speed)))


def _polynomial(
    start: np.ndarray, goal: np.ndarray, passed: float, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    s = min(1.0, max(0.0, passed / duration))
    way = goal - start
    position = start + s**3 * (10.0 - 15.0 * s + 6.0 * s**2) * way
    return position, 30.0 * s**2 * (1.0 - s) ** 2 / duration * way
