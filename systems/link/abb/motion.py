"""Motion generation of a controller under EGM: from received references to joint motion."""

import math
from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, ValueProducer

from robots.configuration.quantity import quantity
from robots.description.model import NUM_JOINTS
from systems.sampled_system import SampledSystem

_POSITION, _VELOCITY, _RAMP = slice(0, 6), slice(6, 12), 12
_WIDTH = 13


@dataclass
class EgmMotionConfig:
    """The settings that EGM has on a controller, Probst (2024), table A.1; read from a scenario file."""

    # 0 to 20: speed per difference between reference and position
    gain: float = quantity(20.0, 0.0, 20.0, "1/s")
    bandwidth: float = quantity(100.0, 0.0, 1000.0, "Hz")  # of the low-pass filter on the speed; 0 for none
    ramp_in: float = quantity(0.005, 0.0, 10.0, "s")  # in which EGM takes over
    # Of one joint, largest speed that EGM may add (assumed)
    largest_speed_deviation_deg_s: float = quantity(300.0, 0.0, 1000.0, "deg/s")
    stop_time: float = quantity(0.2, 0.0, 10.0, "s")  # from full speed to rest when EGM ends (assumed)


class EgmMotion(SampledSystem):
    """Plans the joints' motion: speed = gain (reference - position) + speed reference, filtered and limited.

    Ports:
        in  ``position_command``  vector 6 in rad, the reference; NaN where only speeds are given
        in  ``velocity_command``  vector 6 in rad/s, the speed reference; NaN brings the robot to rest
        out ``position_command``  vector 6 in rad, planned
        out ``velocity_command``  vector 6 in rad/s, planned

    The position in the formula is the planned one, which the drives follow. At every tick the plan for this
    instant is made from the reference that lies at the ports; there is no delay but that of the filter.
    """

    def __init__(self, config: EgmMotionConfig, period: float, takes_position: bool = True) -> None:
        """Checks the configuration.

        Args:
            config: of EGM.
            period: the controller's cycle in s.
            takes_position: False to follow speeds alone, whatever the reference is.

        Raises:
            ValueError: if the gain is not between 0 and 20, or another number is negative.
        """
        super().__init__()
        if not 0.0 <= config.gain <= 20.0:
            raise ValueError(f"EGM: gain must be between 0 and 20 1/s, got {config.gain}")
        for name in ("bandwidth", "ramp_in", "largest_speed_deviation_deg_s", "stop_time"):
            if not getattr(config, name) >= 0.0:
                raise ValueError(f"EGM: {name} must not be negative, got {getattr(config, name)}")
        self._period, self._gain = period, config.gain if takes_position else 0.0
        self._share = 1.0 - math.exp(-2.0 * math.pi * config.bandwidth * period) if config.bandwidth else 1.0
        self._ramp_step = period / config.ramp_in if config.ramp_in > period else 1.0
        self._largest = math.radians(config.largest_speed_deviation_deg_s)
        self._brake_share = period / config.stop_time if config.stop_time > period else 1.0
        self._position = self.DeclareVectorInputPort("position_command", NUM_JOINTS)
        self._velocity = self.DeclareVectorInputPort("velocity_command", NUM_JOINTS)
        # Planned position and velocity, the share of the ramp, and the velocity from which braking began.
        state = self.DeclareDiscreteState(np.zeros(_WIDTH + NUM_JOINTS))
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
        state = np.zeros(_WIDTH + NUM_JOINTS)
        state[_POSITION] = position
        context.SetDiscreteState(0, state)

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
        reference, speed = self._position.Eval(context), self._velocity.Eval(context)
        ahead = position + self._period * velocity
        if math.isnan(speed[0]):
            braking_from = state[_WIDTH:]
            top, now = float(np.abs(braking_from).max()), float(np.abs(velocity).max())
            left = max(0.0, now / top - self._brake_share) if top > 0.0 else 0.0
            planned, state[_RAMP] = left * braking_from, 0.0
        else:
            state[_RAMP] = min(1.0, state[_RAMP] + self._ramp_step)
            wanted = speed if math.isnan(reference[0]) else speed + self._gain * (reference - ahead)
            wanted = state[_RAMP] * np.minimum(np.maximum(wanted, -self._largest), self._largest)
            planned = velocity + self._share * (wanted - velocity)
            state[_WIDTH:] = planned
        # A speed that changes evenly, as the set-point of the drives does.
        state[_POSITION] = position + 0.5 * self._period * (velocity + planned)
        state[_VELOCITY] = planned
        value.set_value(state)

    def _remember(self, context: Context, discrete_state: DiscreteValues) -> None:
        discrete_state.set_value(0, self._next.Eval(context))
