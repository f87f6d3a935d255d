"""Motors and gears made of the parts that a robot file names: lag, friction, play, hysteresis and so on."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Demultiplexer, Integrator, LinearSystem

from robots.drivetrain.train import DriveTrains


class PartsDriveTrain(Diagram):
    """Drive trains of n joints, each with its parts, beside a plant of the links alone.

    Ports:
        in  ``motor_torque``  vector n in N m, joint side: what the motors are told to give
        in  ``link_state``    vector 2 n, link positions behind the gears (rad), then velocities (rad/s)
        out ``motor_state``   vector 2 n, positions of the motors (rad), then velocities (rad/s)
        out ``gear_torque``   vector n in N m, what the gears give the links

    The equations are those of `DriveTrains`. They are evaluated by one call of Python for each derivative;
    the states, of the motors and of the parts, stand in systems of Drake's.
    """

    def __init__(self, trains: DriveTrains) -> None:
        """Takes the trains in the order of the joints."""
        super().__init__()
        self.trains = trains
        builder, n, states = DiagramBuilder(), trains.size, trains.num_states
        self._motors = builder.AddNamedSystem("motors", _motors(trains.inertia))
        parts = builder.AddNamedSystem("parts", _Parts(trains))
        split = builder.AddNamedSystem("split", Demultiplexer([n, n, states] if states else [n, n]))
        builder.Connect(parts.get_output_port(), split.get_input_port())
        builder.Connect(split.get_output_port(0), self._motors.get_input_port())
        builder.Connect(self._motors.get_output_port(), parts.GetInputPort("motor_state"))
        self._memory = None
        if states:
            self._memory = builder.AddNamedSystem("memory", Integrator(states))
            builder.Connect(split.get_output_port(2), self._memory.get_input_port())
            builder.Connect(self._memory.get_output_port(), parts.GetInputPort("memory"))
        for name in ("motor_torque", "link_state"):
            builder.ExportInput(parts.GetInputPort(name), name)
        builder.ExportOutput(self._motors.get_output_port(), "motor_state")
        builder.ExportOutput(split.get_output_port(1), "gear_torque")
        builder.BuildInto(self)

    def set_at_rest(self, root_context: Context, theta: np.ndarray, load: np.ndarray | None = None) -> None:
        """Puts the motors at theta, still.

        Args:
            root_context: of the diagram that this is part of.
            theta: rad, shape (n,).
            load: what pulls at the links in N m, shape (n,), which the gears are to be wound up for.
        """
        still = np.concatenate([theta, np.zeros_like(theta)])
        self._motors.GetMyMutableContextFromRoot(root_context).SetContinuousState(still)
        if self._memory is not None:
            state = self.trains.at_rest(np.zeros_like(theta) if load is None else load, theta)[1]
            self._memory.set_integral_value(self._memory.GetMyMutableContextFromRoot(root_context), state)

    def wind_up(self, torque: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """How far the gears yield at rest, in rad, to torques on their links in N m; shape (n,) each."""
        return self.trains.at_rest(torque, theta)[0]

    def energy(self, root_context: Context, link_position: np.ndarray) -> float:
        """What motors and gears have stored in J with the links at a position in rad, shape (n,)."""
        n = self.trains.size
        motors = self._motors.GetMyContextFromRoot(root_context).get_continuous_state_vector().CopyToVector()
        memory = np.zeros(0)
        if self._memory is not None:
            context = self._memory.GetMyContextFromRoot(root_context)
            memory = context.get_continuous_state_vector().CopyToVector()
        theta, speed = motors[:n], motors[n:]
        moving = 0.5 * float(self.trains.inertia @ speed**2)
        return moving + self.trains.energy(memory, theta, link_position - theta)


def _motors(inertia: np.ndarray) -> LinearSystem:
    """Positions and velocities of rotors under torques."""
    n = len(inertia)
    A, B = np.eye(2 * n, k=n), np.vstack([np.zeros((n, n)), np.diag(1.0 / inertia)])
    return LinearSystem(A, B, np.eye(2 * n), np.zeros((2 * n, n)))


class _Parts(LeafSystem):
    """Torques on motors and links and the rates of the states, as one vector."""

    def __init__(self, trains: DriveTrains) -> None:
        super().__init__()
        self._trains, n = trains, trains.size
        self._motor = self.DeclareVectorInputPort("motor_state", 2 * n)
        self._link = self.DeclareVectorInputPort("link_state", 2 * n)
        self._command = self.DeclareVectorInputPort("motor_torque", n)
        ports = [self._motor, self._link, self._command]
        self._memory = None
        if trains.num_states:
            self._memory = self.DeclareVectorInputPort("memory", trains.num_states)
            ports.append(self._memory)
        size = 2 * n + trains.num_states
        self.DeclareVectorOutputPort("torques", size, self._calc, {port.ticket() for port in ports})

    def _calc(self, context: Context, output: BasicVector) -> None:
        n, motor = self._trains.size, self._motor.Eval(context)
        memory = motor[:0] if self._memory is None else self._memory.Eval(context)
        deflection = self._link.Eval(context) - motor
        found = self._trains.torques(
            memory, (motor[:n], motor[n:]), (deflection[:n], deflection[n:]), self._command.Eval(context)
        )
        output.SetFromVector(np.concatenate([found.motor, found.link, found.state_rate]))
