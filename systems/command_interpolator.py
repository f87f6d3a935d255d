"""Turns commands that arrive every few milliseconds into a smooth set-point for continuous control."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from robots.model import NUM_JOINTS

_WIDTH = 2 * NUM_JOINTS  # one command: positions, then velocities


class CommandInterpolator(LeafSystem):
    """Steers a double integrator through the commands, each one a given delay after its issue.

    A command (p, v) issued at time s says "be at p with velocity v". At every tick t the interpolator
    picks the command whose time has come, i.e. where to be at t + period is what was wanted at
    t + period - delay, carries it there by its own velocity if that instant lies between two commands,
    and holds the acceleration that leads the set-point there. So the set-point moves on parabolas with
    continuous velocity; it reaches any command exactly within two periods (dead beat), and it follows a
    smooth command with an error of only jerk * period^3 / 12. A position that is merely held for a period
    would be late by half of it. With the shortest delay, one period, the next command is not yet known and
    the last one is carried on uniformly: that costs acceleration * period^2 / 2.

    Ports:
        in  ``position_command``  vector 6 in rad
        in  ``velocity_command``  vector 6 in rad/s
        in  ``setpoint``          vector 12, state of the double integrator
        out ``acceleration``      vector 6 in rad/s^2, held between ticks
    """

    def __init__(self, period: float, delay: float, tracks_position: bool = True) -> None:
        """Chooses which command to follow at a tick.

        Args:
            period: time between commands in s.
            delay: time from the issue of a command to the instant the set-point is at it, in s.
            tracks_position: False for velocity control, where only the velocity command counts.

        Raises:
            ValueError: if the period is not positive or the delay is shorter than one period.
        """
        super().__init__()
        if not period > 0.0:
            raise ValueError(f"drive: period must be positive, got {period} s")
        if delay < period * (1.0 - 1e-9):
            raise ValueError(
                f"drive: command_delay + dead_time must be at least one command period of {period} s, because a "
                f"command is interpolated over one period; got {delay} s"
            )
        # A command read at a tick was issued one period ago; index 0 is that one, then older ones.
        self._index = max(0, int(np.ceil((delay - 2.0 * period) / period - 1e-9)))
        self._lead = 2.0 * period - delay + self._index * period
        # Dead beat for a double integrator under a held acceleration.
        self._position_gain = 1.0 / period**2 if tracks_position else 0.0
        self._velocity_gain = 1.5 / period if tracks_position else 1.0 / period
        self._period = period
        self._position = self.DeclareVectorInputPort("position_command", NUM_JOINTS)
        self._velocity = self.DeclareVectorInputPort("velocity_command", NUM_JOINTS)
        self._setpoint = self.DeclareVectorInputPort("setpoint", _WIDTH)
        acceleration = self.DeclareDiscreteState(NUM_JOINTS)
        self._transit = self.DeclareDiscreteState(max(1, self._index) * _WIDTH)
        self.DeclareStateOutputPort("acceleration", acceleration)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def set_at_rest(self, context: Context, position: np.ndarray) -> None:
        """Fills the transit with commands to stand still at position (rad, shape (6,))."""
        still = np.concatenate([position, np.zeros(NUM_JOINTS)])
        count = context.get_discrete_state(self._transit).size() // _WIDTH
        context.SetDiscreteState(self._transit, np.tile(still, count))

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        command = np.concatenate([self._position.Eval(context), self._velocity.Eval(context)])
        if self._index > 0:
            transit = context.get_discrete_state(self._transit).value()
            discrete_state.set_value(1, np.concatenate([command, transit[:-_WIDTH]]))
            command = transit[-_WIDTH:]
        setpoint = self._setpoint.Eval(context)
        velocity = command[NUM_JOINTS:]
        # Where a uniform motion that ends at the command would be now.
        position = command[:NUM_JOINTS] + (self._lead - self._period) * velocity
        acceleration = self._position_gain * (position - setpoint[:NUM_JOINTS])
        acceleration += self._velocity_gain * (velocity - setpoint[NUM_JOINTS:])
        discrete_state.set_value(0, acceleration)
