"""Commands that reach the drives later or sooner than they used to."""

from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues

from robots.description.model import NUM_JOINTS
from systems.cell.events.station_events import DeadTimeChange, StationEvent, of_kind
from systems.sampled_system import SampledSystem

_WIDTH = 3 * NUM_JOINTS  # positions, velocities, torques


def shortest_dead_time(events: Sequence[StationEvent], dead_time: float) -> float:
    """The shortest dead time in s of a run that begins with ``dead_time``."""
    return min([dead_time, *(event.dead_time for event in of_kind(events, DeadTimeChange))])


class ChangingDelay(SampledSystem):
    """Delays commands by what the dead time is longer than the shortest of the run.

    While the dead time grows, commands are carried out slower than they were given; no motion is left out.

    Ports:
        in  ``position_command``    vector 6 in rad
        in  ``velocity_command``    vector 6 in rad/s
        in  ``torque_feedforward``  vector 6 in N m, joint side; may stay unconnected
        out the same three
    """

    def __init__(self, events: Sequence[StationEvent], dead_time: float, period: float) -> None:
        """Lays the dead times out in time.

        Args:
            events: of which `DeadTimeChange` is heard; checked by `check_events`.
            dead_time: before the first of them, in s.
            period: between two commands in s.
        """
        super().__init__()
        self._period = period
        shortest = shortest_dead_time(events, dead_time)
        times, delays = [0.0], [dead_time - shortest]
        for event in of_kind(events, DeadTimeChange):
            times += [event.at, event.at + event.over]
            delays += [delays[-1], event.dead_time - shortest]
        self._times, self._delays = np.array(times), np.array(delays)
        # The newest command is that of the tick before; two more for what lies between ticks.
        self._kept = int(np.ceil(max(delays) / period - 1e-9)) + 3
        names = ("position_command", "velocity_command", "torque_feedforward")
        self._inputs = [self.DeclareVectorInputPort(name, NUM_JOINTS) for name in names]
        self._ring = self.DeclareDiscreteState(np.full(self._kept * _WIDTH, np.nan))
        for index, name in enumerate(names):
            self.DeclareVectorOutputPort(name, NUM_JOINTS, self._part(index))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._keep)

    def set_at_rest(self, context: Context, theta: np.ndarray) -> None:
        """As if there had always been commands to stand still at theta (rad, shape (6,))."""
        still = np.concatenate([theta, np.zeros(2 * NUM_JOINTS)])
        context.SetDiscreteState(np.tile(still, self._kept))

    def extra_delay(self, time: float) -> tuple[float, float]:
        """By how much commands are late at a time, in s, and how fast that grows, without unit."""
        delay = float(np.interp(time, self._times, self._delays))
        i = int(np.searchsorted(self._times, time, side="right")) - 1
        if i + 1 >= len(self._times):
            return delay, 0.0
        span = self._times[i + 1] - self._times[i]
        return delay, float((self._delays[i + 1] - self._delays[i]) / span) if span > 0.0 else 0.0

    def _newest(self, context: Context) -> np.ndarray:
        torque = self._inputs[2]
        last = torque.Eval(context) if torque.HasValue(context) else np.zeros(NUM_JOINTS)
        return np.concatenate([self._inputs[0].Eval(context), self._inputs[1].Eval(context), last])

    def _keep(self, context: Context, discrete_state: DiscreteValues) -> None:
        ring = discrete_state.get_mutable_value(self._ring)
        ring[_WIDTH:] = ring[:-_WIDTH].copy()
        ring[:_WIDTH] = self._newest(context)

    def _command(self, context: Context) -> np.ndarray:
        """The command of an earlier instant, between two ticks on the cubic that both of them say."""
        delay, growth = self.extra_delay(context.get_time())
        entries = np.vstack(
            [self._newest(context), context.get_discrete_state(0).value().reshape(-1, _WIDTH)]
        )
        k = min(int(delay / self._period + 1e-9), len(entries) - 2)
        s = delay / self._period - k
        if s < 1e-9 and growth == 0.0:
            return entries[k]
        newer, older = entries[k], entries[k + 1]
        (p1, v1, tau1), (p0, v0, tau0) = newer.reshape(3, -1), older.reshape(3, -1)
        u, T = 1.0 - s, self._period  # from the older one to the newer one
        h = (2 * u**3 - 3 * u**2 + 1, u**3 - 2 * u**2 + u, -2 * u**3 + 3 * u**2, u**3 - u**2)
        position = h[0] * p0 + h[1] * T * v0 + h[2] * p1 + h[3] * T * v1
        velocity = (1.0 - growth) * (u * v1 + (1.0 - u) * v0)
        return np.concatenate([position, velocity, u * tau1 + (1.0 - u) * tau0])

    def _part(self, index: int):
        def calc(context: Context, output: BasicVector) -> None:
            output.set_value(self._command(context)[index * NUM_JOINTS : (index + 1) * NUM_JOINTS])

        return calc
