"""Controlled joints: from commands every few milliseconds to motor torques.

Made of Drake's C++ systems alone.
"""

from dataclasses import dataclass, field

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.controllers import InverseDynamics
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    MatrixGain,
    ZeroOrderHold,
)

from robots.configuration.quantity import numbers, positive, quantity
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import add_robot
from systems.cell.command_interpolator import CommandInterpolator
from systems.cell.motors import PidGains
from systems.cell.torque_delay import TorqueDelay

KINDS = ("position", "velocity", "cascade")


@dataclass
class PiGains:
    """A PI controller; the output is a motor torque in N m."""

    proportional: float = quantity(0.0, 0.0)  # per joint-side rad (position) or rad/s (velocity)
    integral: float = quantity(0.0, 0.0)  # the same, per second


@dataclass
class CascadeGains:
    """Position controller around a PI velocity controller, as industrial drives have it."""

    position: float = positive(25.0, "1/s")  # speed per position error
    velocity: float = positive(100.0, "1/s")  # joint torque per velocity error and joint inertia
    integral: float = quantity(10.0, 0.0, unit="1/s")  # the inverse of the integral action time


@dataclass
class DriveConfig:
    """How the joints are controlled; read from a scenario file.

    The gains of Probst (2024), sections 5.2 and 5.3, are read as motor torque per joint-side error, so that
    the torque at the joint is the gear ratio times as large.
    """

    position: PiGains = field(default_factory=lambda: PiGains(80.0, 1.0))
    velocity: PiGains = field(default_factory=lambda: PiGains(100.0, 1.0))
    # Of each joint, times the gains of `position` and `velocity`: those are torques of the motors of one
    # robot, and the motors of another one have to turn more or less. A cascade knows what it turns.
    motor_factors: list[float] = numbers((1.0,) * NUM_JOINTS, (NUM_JOINTS,), 0.0, is_open=True)
    cascade: CascadeGains = field(default_factory=CascadeGains)
    # Transport, from the issue of a command to the instant the drive is at it
    command_delay: float = quantity(4e-3, 0.0, 1.0, "s")
    dead_time: float = quantity(0.0, 0.0, 1.0, "s")  # of the controller's interface, on top of the transport
    # The load that the drives are told; None for the station's
    payload: float | None = quantity(None, 0.0, 1000.0, "kg")


class Drive(Diagram):
    """What the controllers of six joints compute at every tick; their loops are in `systems.cell.motors`.

    Ports:
        in  ``position_command``    vector 6 in rad
        in  ``velocity_command``    vector 6 in rad/s
        in  ``torque_feedforward``  vector 6 in N m, joint side; only if it is taken
        in  ``motor_state``         vector 12, motor positions (rad), then velocities (rad/s)
        in  ``setpoint``            vector 12, positions and velocities of the set-points
        out ``acceleration``        vector 6 in rad/s^2, of the set-points until the next tick
        out ``added_torque``        vector 6 in N m, what the motors give beside the torque of the controllers

    All three kinds are one PID law on the interpolated command, because the PI loops of a cascade
    multiply out to it. A velocity-controlled joint follows the integral of its velocity command.
    Gravity, and the counterbalance if there is one, are compensated with the nominal rigid model of the
    robot and its payload. That torque is held for a period; it is the one at the positions at which the
    motors will be in the middle of it if they go on as they do.
    """

    def __init__(
        self,
        robot: RobotModel,
        kind: str,
        config: DriveConfig,
        period: float,
        payload: float = 0.0,
        takes_torque: bool = False,
    ) -> None:
        """Wires the drive.

        Args:
            robot: the nominal robot.
            kind: ``"position"``, ``"velocity"`` or ``"cascade"``.
            config: gains and delays.
            period: time between commands in s.
            payload: mass at the flange in kg that the gravity compensation knows of.
            takes_torque: whether it takes a torque feedforward, which is as late as the positions are.

        Raises:
            ValueError: if the kind is unknown or the delay is shorter than one period.
        """
        super().__init__()
        builder = DiagramBuilder()
        delay = config.command_delay + config.dead_time
        interpolator = CommandInterpolator(period, delay, tracks_position=kind != "velocity")
        self._interpolator = builder.AddNamedSystem("interpolator", interpolator)
        # Kept as a member: the system that computes the load only refers to it.
        self._rigid_plant = MultibodyPlant(0.0)
        self._rigid = add_robot(self._rigid_plant, robot, "rigid", payload)
        self._rigid_plant.Finalize()
        self.gains = _pid_gains(robot, kind, config, self._rigid_plant)
        ahead = builder.AddNamedSystem("ahead", MatrixGain(_half_a_tick_ahead(period)))
        load = _add_load_compensation(builder, self._rigid_plant, robot.counterbalance is not None)
        self._held_load = builder.AddNamedSystem("held_load", ZeroOrderHold(period, NUM_JOINTS))
        added_torque = self._held_load.get_output_port()
        builder.Connect(ahead.get_output_port(), load.get_input_port_estimated_state())
        builder.Connect(load.get_output_port_generalized_force(), self._held_load.get_input_port())
        if takes_torque:
            late = builder.AddNamedSystem("torque_delay", TorqueDelay(period, delay))
            added = builder.AddNamedSystem("added_torque", Adder(2, NUM_JOINTS))
            builder.Connect(added_torque, added.get_input_port(0))
            builder.Connect(late.get_output_port(), added.get_input_port(1))
            builder.ExportInput(late.get_input_port(), "torque_feedforward")
            added_torque = added.get_output_port()
        for name in ("position_command", "velocity_command", "setpoint"):
            builder.ExportInput(self._interpolator.GetInputPort(name), name)
        builder.ExportInput(ahead.get_input_port(), "motor_state")
        builder.ExportOutput(self._interpolator.GetOutputPort("acceleration"), "acceleration")
        builder.ExportOutput(added_torque, "added_torque")
        builder.BuildInto(self)

    def set_at_rest(self, root_context: Context, theta: np.ndarray) -> None:
        """Puts the commands in transit at the motor positions theta (rad, shape (6,)), and holds the load."""
        self._interpolator.set_at_rest(root_context, theta)
        rigid = self._rigid_plant.CreateDefaultContext()
        self._rigid_plant.SetPositions(rigid, theta)
        held = self._held_load.GetMyMutableContextFromRoot(root_context)
        self._held_load.SetVectorState(held, -self._rigid.load(rigid))


def _pid_gains(robot: RobotModel, kind: str, config: DriveConfig, rigid_plant: MultibodyPlant) -> PidGains:
    """Joint-side gains of the PID law that the drive amounts to."""
    ratio = robot.gear_ratio * np.asarray(config.motor_factors)
    if kind == "position":
        return PidGains(config.position.proportional * ratio, config.position.integral * ratio, 0.0 * ratio)
    if kind == "velocity":
        # The integral of the velocity error is the error against the integrated command.
        return PidGains(config.velocity.integral * ratio, 0.0 * ratio, config.velocity.proportional * ratio)
    if kind == "cascade":
        gains = config.cascade
        velocity = gains.velocity * _joint_inertias(rigid_plant)
        return PidGains(
            velocity * (gains.position + gains.integral),
            velocity * gains.position * gains.integral,
            velocity,
        )
    raise ValueError(f"drive kind must be one of {', '.join(KINDS)}, got '{kind}'")


def _half_a_tick_ahead(period: float) -> np.ndarray:
    """From a state to the position half a period later, at rest there."""
    one, o = np.eye(NUM_JOINTS), np.zeros((NUM_JOINTS, NUM_JOINTS))
    return np.block([[one, 0.5 * period * one], [o, o]])


def _add_load_compensation(
    builder: DiagramBuilder, plant: MultibodyPlant, has_counterbalance: bool
) -> InverseDynamics:
    """Adds a system from a state at rest to the torque that holds the rigid robot there."""
    modes = InverseDynamics.InverseDynamicsMode
    if not has_counterbalance:
        return builder.AddNamedSystem("load", InverseDynamics(plant, modes.kGravityCompensation))
    # The mode for gravity leaves springs between bodies out; without motion the other one has just the two.
    load = builder.AddNamedSystem("load", InverseDynamics(plant, modes.kInverseDynamics))
    at_rest = builder.AddNamedSystem("at_rest", ConstantVectorSource(np.zeros(NUM_JOINTS)))
    builder.Connect(at_rest.get_output_port(), load.get_input_port_desired_acceleration())
    return load


def _joint_inertias(rigid_plant: MultibodyPlant) -> np.ndarray:
    """What each motor has to turn at zero joint positions, rotor included, in kg m^2, shape (6,)."""
    return np.diag(rigid_plant.CalcMassMatrix(rigid_plant.CreateDefaultContext())).copy()
