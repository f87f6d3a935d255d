"""Controlled joints: from commands every few milliseconds to motor torques, with gravity and friction.

Made of Drake's C++ systems alone.
"""

from dataclasses import dataclass, field

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.controllers import InverseDynamics, PidController
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, InputPort, LeafSystem, OutputPort
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    LinearSystem,
    MatrixGain,
    MultilayerPerceptron,
    PerceptronActivationType,
)

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import add_robot
from systems.cell.command_interpolator import CommandInterpolator

KINDS = ("position", "velocity", "cascade")


@dataclass
class PiGains:
    """A PI controller; the output is a motor torque in N m."""

    proportional: float = 0.0  # per joint-side rad (position) or rad/s (velocity)
    integral: float = 0.0  # the same, per second


@dataclass
class CascadeGains:
    """Position controller around a PI velocity controller, as industrial drives have it."""

    position: float = 25.0  # 1/s
    velocity: float = 100.0  # 1/s, joint torque per velocity error and joint inertia
    integral: float = 10.0  # 1/s, the inverse of the integral action time


@dataclass
class DriveConfig:
    """How the joints are controlled; read from a scenario file.

    The gains of Probst (2024), sections 5.2 and 5.3, are read as motor torque per joint-side error, so that
    the torque at the joint is the gear ratio times as large.
    """

    position: PiGains = field(default_factory=lambda: PiGains(80.0, 1.0))
    velocity: PiGains = field(default_factory=lambda: PiGains(100.0, 1.0))
    cascade: CascadeGains = field(default_factory=CascadeGains)
    command_delay: float = 4e-3  # s, transport: from the issue of a command to the instant the drive is at it
    dead_time: float = 0.0  # s, of the controller's interface, on top of the transport
    payload: float | None = None  # kg, the load that the drives are told; None for the station's


class Drive(Diagram):
    """Six controlled joints.

    Ports:
        in  ``position_command``    vector 6 in rad
        in  ``velocity_command``    vector 6 in rad/s
        in  ``torque_feedforward``  vector 6 in N m, joint side
        in  ``motor_state``         vector 12, motor positions (rad), then velocities (rad/s)
        out ``motor_torque``        vector 6 in N m, joint side: what the motors give
        out ``joint_torque``        vector 6 in N m, the same less the Coulomb friction: what the joints get

    All three kinds are one PID law on the interpolated command, because the PI loops of a cascade
    multiply out to it. A velocity-controlled joint follows the integral of its velocity command.
    Gravity, and the counterbalance if there is one, are compensated with the nominal rigid model of the
    robot and its payload at the motors' positions.
    """

    def __init__(
        self, robot: RobotModel, kind: str, config: DriveConfig, period: float, payload: float = 0.0
    ) -> None:
        """Wires the drive.

        Args:
            robot: the nominal robot.
            kind: ``"position"``, ``"velocity"`` or ``"cascade"``.
            config: gains and delays.
            period: time between commands in s.
            payload: mass at the flange in kg that the gravity compensation knows of.

        Raises:
            ValueError: if the kind is unknown or the delay is shorter than one period.
        """
        super().__init__()
        self.robot = robot
        builder = DiagramBuilder()
        self._interpolator = builder.AddNamedSystem(
            "interpolator",
            CommandInterpolator(
                period, config.command_delay + config.dead_time, tracks_position=kind != "velocity"
            ),
        )
        self._setpoint = builder.AddNamedSystem("setpoint", _double_integrator())
        # Kept as a member: the gravity system only refers to it.
        self._rigid_plant = MultibodyPlant(0.0)
        add_robot(self._rigid_plant, robot, "rigid", payload)
        self._rigid_plant.Finalize()
        self._gains = kp, ki, kd = _pid_gains(robot, kind, config, self._rigid_plant)
        controller = builder.AddNamedSystem("controller", PidController(kp, ki, kd))
        load_input, load = _load_compensation(builder, self._rigid_plant, robot.counterbalance is not None)
        self._friction = builder.AddNamedSystem("friction", _coulomb_friction())
        motor_torque = builder.AddNamedSystem("motor_torque", Adder(3, NUM_JOINTS))
        joint_torque = builder.AddNamedSystem("joint_torque", Adder(2, NUM_JOINTS))

        builder.Connect(self._interpolator.GetOutputPort("acceleration"), self._setpoint.get_input_port())
        builder.Connect(self._setpoint.get_output_port(), self._interpolator.GetInputPort("setpoint"))
        builder.Connect(self._setpoint.get_output_port(), controller.get_input_port_desired_state())
        builder.Connect(controller.get_output_port_control(), motor_torque.get_input_port(0))
        builder.Connect(load, motor_torque.get_input_port(1))
        builder.Connect(motor_torque.get_output_port(), joint_torque.get_input_port(0))
        builder.Connect(self._friction.get_output_port(), joint_torque.get_input_port(1))

        builder.ExportInput(self._interpolator.GetInputPort("position_command"), "position_command")
        builder.ExportInput(self._interpolator.GetInputPort("velocity_command"), "velocity_command")
        builder.ExportInput(motor_torque.get_input_port(2), "torque_feedforward")
        motor_state = builder.ExportInput(self._friction.get_input_port(), "motor_state")
        for port in (controller.get_input_port_estimated_state(), load_input):
            builder.ConnectInput(motor_state, port)
        builder.ExportOutput(motor_torque.get_output_port(), "motor_torque")
        builder.ExportOutput(joint_torque.get_output_port(), "joint_torque")
        builder.BuildInto(self)

    def linear_gains(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness (N m / rad) and damping (N m s / rad) about rest, joint side, shape (6,) each."""
        friction_slope = self.robot.joint_coulomb_friction / self.robot.coulomb_velocity
        return self._gains[0], self._gains[2] + friction_slope

    def set_at_rest(self, root_context: Context, theta: np.ndarray) -> None:
        """Puts the set-point and the commands in transit at the motor positions theta (rad, shape (6,)).

        Also writes the friction parameters, which live in the context.
        """
        still = np.concatenate([theta, np.zeros(NUM_JOINTS)])
        self._setpoint.GetMyMutableContextFromRoot(root_context).SetContinuousState(still)
        self._interpolator.set_at_rest(root_context, theta)
        friction, context = self._friction, self._friction.GetMyMutableContextFromRoot(root_context)
        velocity_only = np.hstack(
            [np.zeros((NUM_JOINTS, NUM_JOINTS)), np.diag(1.0 / self.robot.coulomb_velocity)]
        )
        friction.SetWeights(context, 0, velocity_only)
        friction.SetWeights(context, 1, -np.diag(self.robot.joint_coulomb_friction))
        for layer in (0, 1):
            friction.SetBiases(context, layer, np.zeros(NUM_JOINTS))


def _pid_gains(
    robot: RobotModel, kind: str, config: DriveConfig, rigid_plant: MultibodyPlant
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint-side gains of the PID law that the drive amounts to."""
    ratio = robot.gear_ratio
    if kind == "position":
        return config.position.proportional * ratio, config.position.integral * ratio, 0.0 * ratio
    if kind == "velocity":
        # The integral of the velocity error is the error against the integrated command.
        return config.velocity.integral * ratio, 0.0 * ratio, config.velocity.proportional * ratio
    if kind == "cascade":
        gains = config.cascade
        velocity = gains.velocity * _joint_inertias(rigid_plant)
        return (
            velocity * (gains.position + gains.integral),
            velocity * gains.position * gains.integral,
            velocity,
        )
    raise ValueError(f"drive kind must be one of {', '.join(KINDS)}, got '{kind}'")


def _load_compensation(
    builder: DiagramBuilder, plant: MultibodyPlant, has_counterbalance: bool
) -> tuple[InputPort, OutputPort]:
    """From the motor state to the torque that holds the rigid robot at its position."""
    modes = InverseDynamics.InverseDynamicsMode
    if not has_counterbalance:
        gravity = builder.AddNamedSystem("gravity", InverseDynamics(plant, modes.kGravityCompensation))
        return gravity.get_input_port_estimated_state(), gravity.get_output_port_generalized_force()
    # The mode for gravity leaves springs between bodies out; without motion the other one has just the two.
    load = builder.AddNamedSystem("load", InverseDynamics(plant, modes.kInverseDynamics))
    still = builder.AddNamedSystem("still", MatrixGain(np.diag([1.0] * NUM_JOINTS + [0.0] * NUM_JOINTS)))
    at_rest = builder.AddNamedSystem("at_rest", ConstantVectorSource(np.zeros(NUM_JOINTS)))
    builder.Connect(still.get_output_port(), load.get_input_port_estimated_state())
    builder.Connect(at_rest.get_output_port(), load.get_input_port_desired_acceleration())
    return still.get_input_port(), load.get_output_port_generalized_force()


def _joint_inertias(rigid_plant: MultibodyPlant) -> np.ndarray:
    """What each motor has to turn at zero joint positions, rotor included, in kg m^2, shape (6,)."""
    return np.diag(rigid_plant.CalcMassMatrix(rigid_plant.CreateDefaultContext())).copy()


def _double_integrator() -> LeafSystem:
    """Position and velocity under a piecewise constant acceleration, 12 states."""
    zero, one = np.zeros((NUM_JOINTS, NUM_JOINTS)), np.eye(NUM_JOINTS)
    A, B = np.block([[zero, one], [zero, zero]]), np.vstack([zero, one])
    return LinearSystem(A, B, np.eye(2 * NUM_JOINTS), np.zeros((2 * NUM_JOINTS, NUM_JOINTS)))


def _coulomb_friction() -> LeafSystem:
    """-d_c tanh(velocity / width), Probst (2024) eq. (2.64), from the motor state.

    A perceptron with one tanh layer is exactly this function, and it is the one C++ system in Drake that
    computes it in continuous time.
    """
    return MultilayerPerceptron(
        [2 * NUM_JOINTS, NUM_JOINTS, NUM_JOINTS],
        [PerceptronActivationType.kTanh, PerceptronActivationType.kIdentity],
    )
