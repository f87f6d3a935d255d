"""A robot with its drives: controllers, drive trains and a plant, wired to each other."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import (
    Adder,
    Demultiplexer,
    LinearSystem,
    MatrixGain,
    Multiplexer,
    Selector,
    SelectorParams,
)
from scipy.linalg import block_diag

from diagrams.scenario.scenario import StationConfig
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import PlantRobot, add_robot
from systems.cell.drive import Drive
from systems.cell.drive_train import CoulombFriction, ElasticDriveTrain, add_stiffening_structure
from systems.cell.motors import controlled_motors, motor_controllers
from systems.cell.parts_drive_train import PartsDriveTrain

_STATE = 2 * NUM_JOINTS  # positions, then velocities


class DriveSignals(NamedTuple):
    """What there is of motors and controllers; torques in N m on the joint side."""

    motors: LinearSystem  # with their controllers
    motor_state: OutputPort
    measured_state: OutputPort  # as the drives see it
    setpoint: OutputPort
    controller_torque: OutputPort  # of the motor torque what depends on the set-point
    joint_torque: OutputPort  # what the joints of the plant get


@dataclass(frozen=True)
class DrivenRobot:
    """The systems of a robot with its drives.

    The plant has the links and, if it yields, the structure. Motors and gears are systems beside it, unless
    the gears are rigid: then the plant has the inertia and the viscous friction of the motors.
    """

    robot: RobotModel
    plant: MultibodyPlant
    links: PlantRobot
    drive: Drive
    drive_train: ElasticDriveTrain | PartsDriveTrain | None  # None for a rigid robot
    motor_torque: OutputPort  # vector 6 in N m, joint side
    signals: DriveSignals

    @property
    def motors(self) -> LinearSystem:
        """The motors with their controllers."""
        return self.signals.motors

    @property
    def motor_state(self) -> OutputPort:
        """Vector 12, positions (rad) and velocities (rad/s) of the motors."""
        return self.signals.motor_state

    @property
    def measured_state(self) -> OutputPort:
        """The same as the drives see it."""
        return self.signals.measured_state

    @property
    def setpoint(self) -> OutputPort:
        """Vector 12, where the interpolated commands are: positions (rad) and velocities (rad/s)."""
        return self.signals.setpoint

    def set_at_rest(self, root_context: Context, theta: np.ndarray, true: np.ndarray | None = None) -> None:
        """Puts everything at rest where the drives see the motors at theta (rad, shape (6,)).

        Args:
            root_context: of the whole diagram.
            theta: what the encoders say.
            true: where the motors are then; None for theta.
        """
        true = theta if true is None else true
        context = self.plant.GetMyMutableContextFromRoot(root_context)
        train, still = self.drive_train, np.zeros(NUM_JOINTS)
        self.links.set_at_rest(context, true, train.wind_up if train else None)
        self.drive.set_at_rest(root_context, theta)
        setpoint_and_integral = [theta, still, still]
        if train:
            train.set_at_rest(root_context, true, self._load(context))
            setpoint_and_integral = [true, still, *setpoint_and_integral]
        motors = self.motors.GetMyMutableContextFromRoot(root_context)
        motors.SetContinuousState(np.concatenate(setpoint_and_integral))

    def _load(self, context: Context) -> np.ndarray:
        """What gravity and the counterbalance do to the driven joints in N m, shape (6,)."""
        return self.links.load(context)[[joint.velocity_start() for joint in self.links.motors]]

    def fastest_rate(self, context: Context) -> float:
        """The largest eigenvalue of plant and drives in magnitude, in 1/s, about a context of the plant."""
        links, gains = self.links, self.drive.gains
        n = self.plant.num_positions()
        M, K, D = self.plant.CalcMassMatrix(context), np.zeros(n), np.zeros(n)
        sprung = [joint.position_start() for joint in links.sprung]
        K[sprung] = links.tangent_stiffness(self.plant.GetPositions(context)[sprung])
        for joint in (*links.motors, *links.sprung):
            D[joint.velocity_start()] += joint.default_damping()
        driven = np.array([joint.velocity_start() for joint in links.motors])
        if self.drive_train is None:
            K[driven] += gains.proportional
            D[driven] += gains.derivative + self.robot.joint_coulomb_friction / self.robot.coulomb_velocity
            return _fastest(M, np.diag(K), np.diag(D))
        # The motors first, then the plant, with the gears between them.
        train = self.drive_train.linearised(self._load(context))
        gears = np.hstack([np.eye(NUM_JOINTS), np.zeros((NUM_JOINTS, n))])
        gears[range(NUM_JOINTS), NUM_JOINTS + driven] = -1.0
        whole = np.asarray(block_diag(np.diag(self.robot.reflected_inertia), M))
        stiff = np.diag(np.concatenate([gains.proportional, K])) + gears.T * train.stiffness @ gears
        damp = np.diag(np.concatenate([gains.derivative + train.friction, D]))
        return _fastest(whole, stiff, damp + gears.T * train.damping @ gears)


def add_driven_robot(
    builder: DiagramBuilder,
    nominal: RobotModel,
    robot: RobotModel,
    config: StationConfig,
    kind: str,
    encoders: LeafSystem | None = None,
    takes_torque: bool = False,
) -> DrivenRobot:
    """Adds plant, drive trains, motors and drives to a diagram.

    The systems that the integrator asks at every step stand side by side: nested ones would cost more.

    Args:
        builder: of the diagram.
        nominal: the robot that the drives take it for.
        robot: the true one but for its geometry, which differs by ``config.errors``.
        config: the station part of a scenario.
        kind: of the drives, ``"position"``, ``"velocity"`` or ``"cascade"``.
        encoders: what makes of the true motor state the one that the drives see; None for nothing.
        takes_torque: whether the drives take a torque feedforward.

    Raises:
        ValueError: if a part refuses its configuration.
    """
    told = config.payload if config.drive.payload is None else config.drive.payload
    drive = Drive(nominal, kind, config.drive, config.period, told, takes_torque)
    builder.AddNamedSystem("drive", drive)
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    is_rigid = config.elasticity == "rigid"
    links = add_robot(plant, robot, config.elasticity, config.payload, config.errors, drive_trains=is_rigid)
    plant.Finalize()
    link_state = plant.get_state_output_port()
    if links.stiffening_structure is not None:
        add_stiffening_structure(builder, links)
    if plant.num_multibody_states() > _STATE:
        selector = builder.AddNamedSystem("link_state", _link_state_selector(links))
        builder.Connect(link_state, selector.get_input_port())
        link_state = selector.get_output_port()
    if encoders:
        builder.AddNamedSystem("encoders", encoders)
    train = None
    if not is_rigid:
        train = PartsDriveTrain(robot) if robot.drive_trains else ElasticDriveTrain(robot)
    torque = builder.AddNamedSystem("motor_torque", Adder(3 if train and encoders else 2, NUM_JOINTS))
    builder.Connect(drive.GetOutputPort("added_torque"), torque.get_input_port(1))
    if train:
        signals = _add_motors(builder, robot, drive, train, link_state, torque.get_output_port(), encoders)
        builder.Connect(signals.joint_torque, plant.get_actuation_input_port())
        if encoders:
            gains = drive.gains
            feedback = np.hstack([-np.diag(gains.proportional), -np.diag(gains.derivative)])
            fed_back = builder.AddNamedSystem("feedback", MatrixGain(feedback))
            builder.Connect(signals.measured_state, fed_back.get_input_port())
            builder.Connect(fed_back.get_output_port(), torque.get_input_port(2))
    else:
        signals = _add_controllers(builder, robot, drive, link_state, encoders)
        builder.Connect(signals.joint_torque, plant.get_actuation_input_port())
    builder.Connect(signals.controller_torque, torque.get_input_port(0))
    builder.Connect(signals.setpoint, drive.GetInputPort("setpoint"))
    builder.Connect(signals.measured_state, drive.GetInputPort("motor_state"))
    return DrivenRobot(robot, plant, links, drive, train, torque.get_output_port(), signals)


def _add_motors(
    builder: DiagramBuilder,
    robot: RobotModel,
    drive: Drive,
    train: ElasticDriveTrain | PartsDriveTrain,
    link_state: OutputPort,
    motor_torque: OutputPort,
    encoders: LeafSystem | None,
) -> DriveSignals:
    """Motors with their controllers on gears that yield."""
    own = controlled_motors(robot, drive.gains, train.friction_unit, sees_itself=encoders is None)
    motors = builder.AddNamedSystem("motors", own)
    parts = builder.AddNamedSystem("motor_signals", Demultiplexer([_STATE, NUM_JOINTS, NUM_JOINTS, _STATE]))
    builder.Connect(motors.get_output_port(), parts.get_input_port())
    motor_state, relative_speed, controller_torque, setpoint = (parts.get_output_port(i) for i in range(4))
    torques = train.add(builder, motor_state, relative_speed, link_state, motor_torque)
    sources = [
        drive.GetOutputPort("acceleration"),
        drive.GetOutputPort("added_torque"),
        torques.friction,
        torques.reaction,
    ]
    measured_state = _seen_by(builder, encoders, motor_state)
    if encoders:
        sources.append(measured_state)
    _feed(builder, sources, motors)
    return DriveSignals(motors, motor_state, measured_state, setpoint, controller_torque, torques.gear_torque)


def _add_controllers(
    builder: DiagramBuilder,
    robot: RobotModel,
    drive: Drive,
    motor_state: OutputPort,
    encoders: LeafSystem | None,
) -> DriveSignals:
    """The controllers of motors that the plant has in it, and their Coulomb friction."""
    controllers = builder.AddNamedSystem("controllers", motor_controllers(drive.gains))
    parts = builder.AddNamedSystem("motor_signals", Demultiplexer([NUM_JOINTS, NUM_JOINTS, _STATE]))
    friction = builder.AddNamedSystem("friction", CoulombFriction(robot))
    torque = builder.AddNamedSystem("joint_torque", Adder(2, NUM_JOINTS))
    measured_state = _seen_by(builder, encoders, motor_state)
    sources = [drive.GetOutputPort("acceleration"), drive.GetOutputPort("added_torque"), measured_state]
    _feed(builder, sources, controllers)
    builder.Connect(controllers.get_output_port(), parts.get_input_port())
    builder.Connect(motor_state, friction.get_input_port())
    builder.Connect(parts.get_output_port(0), torque.get_input_port(0))
    builder.Connect(friction.get_output_port(), torque.get_input_port(1))
    controller_torque, setpoint = parts.get_output_port(1), parts.get_output_port(2)
    return DriveSignals(
        controllers, motor_state, measured_state, setpoint, controller_torque, torque.get_output_port()
    )


def _seen_by(builder: DiagramBuilder, encoders: LeafSystem | None, motor_state: OutputPort) -> OutputPort:
    if encoders is None:
        return motor_state
    builder.Connect(motor_state, encoders.get_input_port())
    return encoders.get_output_port()


def _feed(builder: DiagramBuilder, sources: list[OutputPort], system: LinearSystem) -> None:
    inputs = builder.AddNamedSystem("motor_inputs", Multiplexer([source.size() for source in sources]))
    for index, source in enumerate(sources):
        builder.Connect(source, inputs.get_input_port(index))
    builder.Connect(inputs.get_output_port(), system.get_input_port())


def _fastest(M: np.ndarray, K: np.ndarray, D: np.ndarray) -> float:
    """Of M x'' + D x' + K x = 0."""
    n, inverse = len(M), np.linalg.inv(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, -inverse @ D]])
    return float(np.abs(np.linalg.eigvals(A)).max())


def _link_state_selector(robot: PlantRobot) -> Selector:
    """A system that picks the 12 numbers of the driven joints from the state of a plant with a structure."""
    params = SelectorParams()
    params.inputs = [SelectorParams.InputPortParams(name="state", size=robot.plant.num_multibody_states())]
    selections = [
        SelectorParams.OutputSelection(input_port_index=0, input_offset=i) for i in robot.motor_indices()
    ]
    params.outputs = [SelectorParams.OutputPortParams(name="link_state", selections=selections)]
    return Selector(params)
