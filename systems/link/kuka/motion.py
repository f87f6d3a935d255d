"""Motion of a KUKA controller under RSI: the corrected set-point is reached within the cycle."""

from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, ValueProducer

from robots.configuration.quantity import quantity
from robots.description.model import NUM_JOINTS
from systems.sampled_system import SampledSystem

_POSITION, _VELOCITY, _BRAKING_FROM = slice(0, 6), slice(6, 12), slice(12, 18)


@dataclass
class RsiMotionConfig:
    """How the controller follows a corrected set-point (assumed); read from a scenario file."""

    lag: float = quantity(0.0, 0.0, 1.0, "s")  # of a first-order filter on corrections; 0 for none
    stop_time: float = quantity(0.2, 0.0, 10.0, "s")  # from full speed to rest when RSI ends


class RsiMotion(SampledSystem):
    """Plans the joints' motion from set-points that come once a cycle.

    Ports:
        in  ``position_command``  vector 6 in rad, the corrected set-point; NaN brings the robot to rest
        in  ``velocity_command``  vector 6 in rad/s, for set-points that are made of speeds alone
        out ``position_command``  vector 6 in rad, planned
        out ``velocity_command``  vector 6 in rad/s, planned: the difference of two set-points
    """

    def __init__(self, config: RsiMotionConfig, period: float, takes_position: bool = True) -> None:
        """Takes the controller's cycle in s, and False for set-points that are made of speeds alone."""
        super().__init__()
        self._period, self._takes_position = period, takes_position
        self._share = 1.0 - float(np.exp(-period / config.lag)) if config.lag > 0.0 else 1.0
        self._brake_share = period / config.stop_time if config.stop_time > period else 1.0
        self._position = self.DeclareVectorInputPort("position_command", NUM_JOINTS)
        self._velocity = self.DeclareVectorInputPort("velocity_command", NUM_JOINTS)
        state = self.DeclareDiscreteState(np.zeros(18))
        self._next = self.DeclareCacheEntry(
            "next",
            ValueProducer(Value[object], self._calc_next),
            {self._position.ticket(), self._velocity.ticket(), self.discrete_state_ticket(state)},
        )
        for name, part in (("position_command", _POSITION), ("velocity_command", _VELOCITY)):
            self.DeclareVectorOutputPort(name, NUM_JOINTS, self._slice(part), {self._next.ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def set_at_rest(self, context: Context, position: np.ndarray) -> None:
        """Puts the plan at a position (rad, shape (6,)), at rest."""
        context.SetDiscreteState(0, np.concatenate([position, np.zeros(12)]))

    def planned_position(self, context: Context) -> np.ndarray:
        """The plan of the last tick in rad, shape (6,)."""
        return context.get_discrete_state(0).value()[_POSITION].copy()

    def _slice(self, part: slice):
        def calc(context: Context, output: BasicVector) -> None:
            output.set_value(self._next.Eval(context)[part])

        return calc

    def _calc_next(self, context: Context, value) -> None:
        state = context.get_discrete_state(0).value().copy()
        position, velocity = state[_POSITION], state[_VELOCITY]
        if self._takes_position:
            setpoint = self._position.Eval(context)
        else:
            setpoint = position + self._period * self._velocity.Eval(context)
        if np.isnan(setpoint[0]):
            top, now = float(np.abs(state[_BRAKING_FROM]).max()), float(np.abs(velocity).max())
            left = max(0.0, now / top - self._brake_share) if top > 0.0 else 0.0
            planned = left * state[_BRAKING_FROM]
            state[_POSITION] = position + 0.5 * self._period * (velocity + planned)
        else:
            step = self._share * (setpoint - position)
            planned = step / self._period
            state[_POSITION], state[_BRAKING_FROM] = position + step, planned
        state[_VELOCITY] = planned
        value.set_value(state)

    def _remember(self, context: Context, discrete_state: DiscreteValues) -> None:
        discrete_state.set_value(0, self._next.Eval(context))
