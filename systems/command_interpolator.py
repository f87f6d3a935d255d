"""Turns commands that arrive every few milliseconds into a smooth set-point for continuous control."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from robots.model import NUM_JOINTS

_WIDTH = 2 * NUM_JOINTS  # one command: positions, then velocities


class CommandInterpolator(LeafSystem):
    """Steers a double integrator through the commands, each one a given delay after its issue.

    A command (p, v) issued at time s says "be at p with velocity v". At every tick t the interpolator finds
    where to be at t + period, which is what was wanted at t + period - delay, from the two commands around
    that instant; with a delay of less than two periods the later one is not yet known, and the last two are
    carried on with constant acceleration. It then holds the acceleration that leads the set-point there. So
    the set-point moves on parabolas with continuous velocity; it reaches any command exactly within two
    periods (dead beat), and it follows a smooth command with an error of the order of jerk * period^3. A
    position that is merely held for a period would be late by half of it.

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
                f"drive: command_delay + dead_time must be at least one command period of {period} s, "
                f"because a command is interpolated over one period; got {delay} s"
            )
        # A command read at a tick was issued one period ago: number 0; number k another k periods before.
        self._base = max(0, int(np.ceil((delay - 2.0 * period) / period - 1e-9)))
        self._lead = 2.0 * period - delay + self._base * period
        # Dead beat for a double integrator under a held acceleration.
        self._position_gain = 1.0 / period**2 if tracks_position else 0.0
        self._velocity_gain = 1.5 / period if tracks_position else 1.0 / period
        self._period = period
        self._position = self.DeclareVectorInputPort("position_command", NUM_JOINTS)
        self._velocity = self.DeclareVectorInputPort("velocity_command", NUM_JOINTS)
        self._setpoint = self.DeclareVectorInputPort("setpoint", _WIDTH)
        acceleration = self.DeclareDiscreteState(NUM_JOINTS)
        self._transit = self.DeclareDiscreteState(max(1, self._base) * _WIDTH)
        self.DeclareStateOutputPort("acceleration", acceleration)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def set_at_rest(self, context: Context, position: np.ndarray) -> None:
        """Fills the transit with commands to stand still at position (rad, shape (6,))."""
        still = np.concatenate([position, np.zeros(NUM_JOINTS)])
        count = context.get_discrete_state(self._transit).size() // _WIDTH
        context.SetDiscreteState(self._transit, np.tile(still, count))

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        command = np.concatenate([self._position.Eval(context), self._velocity.Eval(context)])
        transit = discrete_state.get_mutable_value(1)
        commands = np.concatenate([command, transit])
        transit[:] = commands[:-_WIDTH]
        base, newer = self._base * _WIDTH, max(0, self._base - 1) * _WIDTH
        velocity = commands[base + NUM_JOINTS : base + _WIDTH]
        if self._lead > 0.0:
            older = newer + _WIDTH
            change = (
                commands[newer + NUM_JOINTS : newer + _WIDTH] - commands[older + NUM_JOINTS : older + _WIDTH]
            )
            velocity = velocity + self._lead / self._period * change
        setpoint = self._setpoint.Eval(context)
        acceleration = self._velocity_gain * (velocity - setpoint[NUM_JOINTS:])
        if self._position_gain > 0.0:
            # Where a uniform motion that ends at the target would be now.
            position = commands[base : base + NUM_JOINTS] - self._period * velocity
            position += 0.5 * self._lead * (commands[base + NUM_JOINTS : base + _WIDTH] + velocity)
            acceleration += self._position_gain * (position - setpoint[:NUM_JOINTS])
        discrete_state.set_value(0, acceleration)
