"""Gears and friction made of the parts that a robot file names: lag, friction, play, hysteresis and so on."""

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    InputPort,
    OutputPort,
)
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer, Integrator

from robots.description.model import RobotModel
from robots.drivetrain.train import DriveTrains
from systems.cell.drive_train import DriveTrainTorques, LinearGears
from systems.sampled_system import SampledSystem


class PartsDriveTrain:
    """Six gears and the friction of their motors with parts, with the members of `ElasticDriveTrain`."""

    def __init__(self, robot: RobotModel) -> None:
        """Takes the drive trains of a robot that has them.

        Raises:
            ValueError: if a part refuses its numbers.
        """
        trains = robot.drive_trains
        assert trains is not None
        self._trains, self._damping = trains, robot.joint_damping
        self._viscous, self._parts = robot.joint_viscous_friction, None
        self.friction_unit = np.zeros(trains.size)  # all friction is in the reaction

    def add(
        self,
        builder: DiagramBuilder,
        motor_state: OutputPort,
        relative_speed: OutputPort,
        link_state: OutputPort,
        motor_torque: OutputPort,
    ) -> DriveTrainTorques:
        """See `ElasticDriveTrain.add`."""
        self._parts = parts = DriveTrainParts(builder, self._trains, self._viscous)
        none = builder.AddNamedSystem("friction", ConstantVectorSource(self.friction_unit))
        for name, port in (
            ("motor_torque", motor_torque),
            ("motor_state", motor_state),
            ("link_state", link_state),
        ):
            builder.Connect(port, parts.inputs[name])
        return DriveTrainTorques(
            parts.outputs["gear_torque"], parts.outputs["reaction"], none.get_output_port()
        )

    def set_at_rest(self, root_context: Context, theta: np.ndarray, load: np.ndarray) -> None:
        """Relaxed, with motors that give what they have to already; arguments of shape (6,)."""
        assert self._parts is not None  # after `add`
        self._parts.set_at_rest(root_context, theta, load)

    def wind_up(self, load: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """See `ElasticDriveTrain.wind_up`."""
        return self._trains.at_rest(load, theta)[0]

    def linearised(self, load: np.ndarray) -> LinearGears:
        """See `ElasticDriveTrain.linearised`."""
        x = self._trains.at_rest(load, np.zeros_like(load))[0]
        stiffness, friction = self._trains.tangents(x)
        return LinearGears(friction, stiffness, self._damping)


class DriveTrainParts:
    """What stands between n motors and their links, put into a diagram beside them.

    Ports, in ``inputs`` and ``outputs`` by name:
        in  ``motor_torque``  vector n in N m, joint side: what the motors are told to give
        in  ``motor_state``   vector 2 n, positions of the motors (rad), then velocities (rad/s)
        in  ``link_state``    vector 2 n, link positions behind the gears (rad), then velocities (rad/s)
        out ``reaction``      vector n in N m, what is taken from the torques that the motors are told to give
        out ``gear_torque``   vector n in N m, what the gears give the links

    The equations are those of `DriveTrains`, compiled. Each derivative calls Python once; the states of the
    parts stand in a system of Drake's.
    """

    def __init__(
        self, builder: DiagramBuilder, trains: DriveTrains, viscous: np.ndarray | None = None
    ) -> None:
        """Adds and wires the parts.

        Args:
            builder: of the diagram that they come into.
            trains: in the order of the joints.
            viscous: what of the friction is not to be in the reaction because the motors have it already, in
                N m s / rad, shape (n,).
        """
        self.trains = trains
        n, states = trains.size, trains.num_states
        equations = _Parts(trains, np.zeros(n) if viscous is None else viscous)
        parts = builder.AddNamedSystem("drive_train_parts", equations)
        split = builder.AddNamedSystem("gear_torques", Demultiplexer([n, n, states] if states else [n, n]))
        builder.Connect(parts.get_output_port(), split.get_input_port())
        self._memory = None
        if states:
            self._memory = builder.AddNamedSystem("drive_train_memory", Integrator(states))
            builder.Connect(split.get_output_port(2), self._memory.get_input_port())
            builder.Connect(self._memory.get_output_port(), parts.GetInputPort("memory"))
        names = "motor_torque", "motor_state", "link_state"
        self.inputs: dict[str, InputPort] = {name: parts.GetInputPort(name) for name in names}
        self.outputs: dict[str, OutputPort] = {
            "reaction": split.get_output_port(0),
            "gear_torque": split.get_output_port(1),
        }

    def set_at_rest(self, root_context: Context, theta: np.ndarray, load: np.ndarray) -> None:
        """Puts the parts at rest with motors at theta (rad) under loads of the links (N m), (n,) each."""
        if self._memory is not None:
            context = self._memory.GetMyMutableContextFromRoot(root_context)
            self._memory.set_integral_value(context, self.trains.at_rest(load, theta)[1])

    def memory(self, root_context: Context) -> np.ndarray:
        """The states of the parts, shape (num_states,), see `DriveTrains`."""
        if self._memory is None:
            return np.zeros(0)
        context = self._memory.GetMyContextFromRoot(root_context)
        return context.get_continuous_state_vector().CopyToVector()


class _Parts(SampledSystem):
    """Reaction, torques on links and the rates of the states, as one vector."""

    def __init__(self, trains: DriveTrains, viscous: np.ndarray) -> None:
        super().__init__()
        self._evaluate, self._viscous, n = trains.evaluate, viscous, trains.size
        self._command = self.DeclareVectorInputPort("motor_torque", n)
        self._motor = self.DeclareVectorInputPort("motor_state", 2 * n)
        self._link = self.DeclareVectorInputPort("link_state", 2 * n)
        ports = [self._command, self._motor, self._link]
        self._memory = None
        if trains.num_states:
            self._memory = self.DeclareVectorInputPort("memory", trains.num_states)
            ports.append(self._memory)
        size = 2 * n + trains.num_states
        self.DeclareVectorOutputPort("torques", size, self._calc, {port.ticket() for port in ports})

    def _calc(self, context: Context, output: BasicVector) -> None:
        motor = self._motor.Eval(context)
        memory = motor[:0] if self._memory is None else self._memory.Eval(context)
        deflection = self._link.Eval(context) - motor
        torques = output.get_mutable_value()
        self._evaluate(memory, motor, deflection, self._command.Eval(context), self._viscous, torques)
