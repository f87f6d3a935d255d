"""Fine interpolation: from a position and velocity every few milliseconds to a smooth set-point."""

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import DiscreteTimeDelay, LinearSystem, Multiplexer

from robots.description.model import NUM_JOINTS

_WIDTH = 2 * NUM_JOINTS  # one command: positions, then velocities


class CommandInterpolator(Diagram):
    """Steers a double integrator through the commands, each one a given delay after its issue.

    A command (p, v) issued at time s says "be at p with velocity v". At every tick t the interpolator finds
    where to be at t + period, which is what was wanted at t + period - delay, from the two commands around
    that instant; with a delay of less than two periods the later one is not yet known, and the last two are
    carried on with constant acceleration. It then holds the acceleration that leads the set-point there. So
    the set-point moves on parabolas with continuous velocity; it reaches any command exactly within two
    periods (dead beat), and it follows a smooth command with an error of the order of jerk * period^3. A
    position that is merely held for a period would be late by half of it.

    All of this is linear, so Drake's own systems do it without Python.

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
                "station.drive.command_delay + station.drive.dead_time must be at least "
                f"station.period={period:g} s, "
                f"because a command is interpolated over one period; they are {delay:g} s"
            )
        # A command read at a tick was issued one period ago: number 0; number k another k periods before.
        base = max(0, int(np.ceil((delay - 2.0 * period) / period - 1e-9)))
        lead = 2.0 * period - delay + base * period
        builder = DiagramBuilder()
        steering = _steering(period, lead, base > 0, tracks_position)
        self._steering = builder.AddNamedSystem("steering", steering)
        self._transit = None
        if base > 1:
            # The delay takes one period to read its input.
            self._transit = builder.AddNamedSystem("transit", DiscreteTimeDelay(period, base - 2, _WIDTH))
            commands = builder.AddNamedSystem("commands", Multiplexer([NUM_JOINTS, NUM_JOINTS]))
            inputs = builder.AddNamedSystem("inputs", Multiplexer([_WIDTH, _WIDTH]))
            builder.Connect(commands.get_output_port(), self._transit.get_input_port())
            builder.Connect(self._transit.get_output_port(), inputs.get_input_port(0))
        else:
            commands = inputs = builder.AddNamedSystem(
                "inputs", Multiplexer([NUM_JOINTS, NUM_JOINTS, _WIDTH])
            )
        builder.Connect(inputs.get_output_port(), self._steering.get_input_port())
        for index, name in enumerate(("position_command", "velocity_command")):
            builder.ExportInput(commands.get_input_port(index), name)
        builder.ExportInput(inputs.get_input_port(inputs.num_input_ports() - 1), "setpoint")
        builder.ExportOutput(self._steering.get_output_port(), "acceleration")
        builder.BuildInto(self)

    def set_at_rest(self, root_context: Context, position: np.ndarray) -> None:
        """Fills the transit with commands to stand still at position (rad, shape (6,))."""
        still = np.concatenate([position, np.zeros(NUM_JOINTS)])
        context = self._steering.GetMyMutableContextFromRoot(root_context)
        context.SetDiscreteState(np.concatenate([np.zeros(NUM_JOINTS), still]))
        if self._transit:
            context = self._transit.GetMyMutableContextFromRoot(root_context)
            context.SetDiscreteState(np.tile(still, context.get_discrete_state_vector().size() // _WIDTH))


def _steering(period: float, lead: float, is_between: bool, tracks_position: bool) -> LinearSystem:
    """The dead-beat control of a double integrator under a held acceleration.

    Args:
        period: time between commands in s.
        lead: how far the instant to be at lies behind the command that it is found from, in s.
        is_between: whether the newer one of two commands lies behind that instant, so that the older one is
            what it is found from.
        tracks_position: whether positions count.

    Returns:
        Inputs are the newer command and the set-point, states the acceleration and the older command.
    """
    # What the quantities of one joint are made of: p and v of the newer command, of the older one, and of
    # the set-point.
    (p_new, v_new), (p_old, v_old), (p_set, v_set) = np.eye(6).reshape(3, 2, 6)
    p_base, v_base = (p_old, v_old) if is_between else (p_new, v_new)
    velocity = v_base + lead / period * (v_new - v_old)
    if tracks_position:
        # Where a uniform motion that ends at the target would be now.
        position = p_base + 0.5 * lead * (v_base + velocity) - period * velocity
        acceleration = 1.5 / period * (velocity - v_set) + (position - p_set) / period**2
    else:
        acceleration = (velocity - v_set) / period
    one, zero = np.eye(NUM_JOINTS), np.zeros((NUM_JOINTS, NUM_JOINTS))
    from_newer, from_older, from_setpoint = (
        np.kron(acceleration, one).reshape(NUM_JOINTS, 3, _WIDTH).swapaxes(0, 1)
    )
    remembered = np.zeros((_WIDTH, NUM_JOINTS + _WIDTH))
    A = np.vstack([np.hstack([zero, from_older]), remembered])
    B = np.vstack([np.hstack([from_newer, from_setpoint]), np.eye(_WIDTH, 2 * _WIDTH)])
    C, D = np.hstack([one, zero, zero]), np.zeros((NUM_JOINTS, 2 * _WIDTH))
    return LinearSystem(A, B, C, D, period)
