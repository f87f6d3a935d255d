"""What stands between motors and links: gears and the friction of the motors; and a structure that stiffens.

A drive train takes the states of motors and links and gives torques. This one has springs and Coulomb
friction; another kind (with play, hysteresis, losses, other friction) is another class with the members of
`ElasticDriveTrain`, whose `add` may add whatever systems it needs, with states of their own.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.symbolic import Expression, MakeVectorContinuousVariable, tanh
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, MatrixGain, Multiplexer, SymbolicVectorSystem

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import PlantRobot

_STATE = 2 * NUM_JOINTS  # positions, then velocities


class DriveTrainTorques(NamedTuple):
    """The ports of a drive train, vectors of 6."""

    gear_torque: OutputPort  # N m, what the gears give the links
    reaction: OutputPort  # N m, what they take from the motors
    friction: OutputPort  # of the motors against their motion, in the drive train's `friction_unit`


@dataclass(frozen=True)
class LinearGears:
    """Six gears and the friction of their motors, linearised about rest, shape (6,) each."""

    friction: np.ndarray  # N m s / rad, viscous and Coulomb
    stiffness: np.ndarray  # N m / rad
    damping: np.ndarray  # N m s / rad


class ElasticDriveTrain:
    """Gears that are springs, and motors with Coulomb friction.

    The gear torque is c (theta - q) + d (dtheta/dt - dq/dt), and where a gear stiffens what that spring
    takes; the friction is d_c tanh(dtheta/dt / width), Probst (2024) eq. (2.64). All are systems of Drake's
    own: the integrator asks for torques at every stage of every step, which Python would make slow.

    Attributes:
        friction_unit: in which the friction is given, in N m, shape (6,).
    """

    def __init__(self, robot: RobotModel) -> None:
        """Takes springs and friction from a robot."""
        self._robot = robot
        self.friction_unit = robot.joint_coulomb_friction

    def add(
        self,
        builder: DiagramBuilder,
        motor_state: OutputPort,
        relative_speed: OutputPort,
        link_state: OutputPort,
        motor_torque: OutputPort,
    ) -> DriveTrainTorques:
        """Adds the systems to a diagram.

        Args:
            builder: of the diagram.
            motor_state: vector 12, positions of the motors (rad), then velocities (rad/s).
            relative_speed: vector 6, their velocities over the width of Coulomb friction.
            link_state: vector 12, positions of the links behind the gears (rad), then velocities (rad/s).
            motor_torque: vector 6 in N m, what the motors are told to give, for those that do not just do so.
        """
        states = builder.AddNamedSystem("motor_and_link_state", Multiplexer([_STATE, _STATE]))
        gears = builder.AddNamedSystem("gears", _linear_gears(self._robot))
        builder.Connect(motor_state, states.get_input_port(0))
        builder.Connect(link_state, states.get_input_port(1))
        builder.Connect(states.get_output_port(), gears.get_input_port())
        gear_torque = gears.get_output_port()
        if self._robot.stiffening_gears is not None:
            stiffening = builder.AddNamedSystem("stiffening_gears", _stiffening_gears(self._robot))
            whole = builder.AddNamedSystem("gear_torque", Adder(2, NUM_JOINTS))
            builder.Connect(states.get_output_port(), stiffening.get_input_port())
            builder.Connect(gear_torque, whole.get_input_port(0))
            builder.Connect(stiffening.get_output_port(), whole.get_input_port(1))
            gear_torque = whole.get_output_port()
        friction = builder.AddNamedSystem("friction", _smooth_sign())
        builder.Connect(relative_speed, friction.get_input_port())
        return DriveTrainTorques(gear_torque, gear_torque, friction.get_output_port())

    def set_at_rest(self, root_context: Context, theta: np.ndarray, load: np.ndarray) -> None:
        """Springs remember nothing; theta (rad) and load on the links (N m) are of shape (6,)."""

    def wind_up(self, load: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """How far the links yield at rest, in rad, to torques on them in N m, motors at theta; (6,) each."""
        springs = self._robot.stiffening_gears
        return load / self._robot.joint_stiffness if springs is None else springs.deflection(load)

    def linearised(self, load: np.ndarray) -> LinearGears:
        """The linear model at rest under torques on the links in N m, shape (6,)."""
        robot, springs = self._robot, self._robot.stiffening_gears
        stiffness = robot.joint_stiffness if springs is None else springs.stiffness(springs.deflection(load))
        friction = robot.joint_viscous_friction + robot.joint_coulomb_friction / robot.coulomb_velocity
        return LinearGears(friction, stiffness, robot.joint_damping)


class CoulombFriction(Diagram):
    """-d_c tanh(velocity / width), Probst (2024) eq. (2.64), of six motors.

    Ports:
        in  ``motor_state``  vector 12, positions (rad), then velocities (rad/s)
        out ``torque``       vector 6 in N m
    """

    def __init__(self, robot: RobotModel) -> None:
        """Takes the friction from a robot."""
        super().__init__()
        builder = DiagramBuilder()
        zero, slope = np.zeros((NUM_JOINTS, NUM_JOINTS)), np.diag(1.0 / robot.coulomb_velocity)
        relative_speed = builder.AddNamedSystem("relative_speed", MatrixGain(np.hstack([zero, slope])))
        sign = builder.AddNamedSystem("sign", _smooth_sign())
        torque = builder.AddNamedSystem("torque", MatrixGain(-np.diag(robot.joint_coulomb_friction)))
        builder.Connect(relative_speed.get_output_port(), sign.get_input_port())
        builder.Connect(sign.get_output_port(), torque.get_input_port())
        builder.ExportInput(relative_speed.get_input_port(), "motor_state")
        builder.ExportOutput(torque.get_output_port(), "torque")
        builder.BuildInto(self)


def add_stiffening_structure(builder: DiagramBuilder, links: PlantRobot) -> None:
    """Adds what bearings and beams that stiffen take beyond the springs that they have in the plant.

    Args:
        builder: of a diagram with the plant, whose input of generalized forces is free.
        links: the robot in it.
    """
    springs, plant, joints = links.stiffening_structure, links.plant, links.structure
    assert springs is not None
    places, deflections = np.zeros((2, len(joints), plant.num_multibody_states()))
    for row, joint in enumerate(joints):
        deflections[row, joint.position_start()] = places[row, joint.velocity_start()] = 1.0
    bent = builder.AddNamedSystem("structure_deflection", MatrixGain(deflections))
    x = MakeVectorContinuousVariable(len(joints), "x")
    twist = np.array([Expression(each) for each in x], dtype=object)
    # Arithmetic with formulas sets the processor's flag for numbers that are none, of which numpy would warn.
    with np.errstate(invalid="ignore"):
        excess = springs.torque(twist) - springs.c_0 * twist
    stiffening = builder.AddNamedSystem("stiffening_structure", _function_of(x, list(excess)))
    applied = builder.AddNamedSystem("structure_torque", MatrixGain(-places[:, : plant.num_velocities()].T))
    builder.Connect(plant.get_state_output_port(), bent.get_input_port())
    builder.Connect(bent.get_output_port(), stiffening.get_input_port())
    builder.Connect(stiffening.get_output_port(), applied.get_input_port())
    builder.Connect(applied.get_output_port(), plant.get_applied_generalized_force_input_port())


def _smooth_sign() -> SymbolicVectorSystem:
    """The hyperbolic tangent of six numbers; a formula with factors would take Drake far longer."""
    x = MakeVectorContinuousVariable(NUM_JOINTS, "x")
    return _function_of(x, [tanh(each) for each in x])


def _linear_gears(robot: RobotModel) -> MatrixGain:
    """The torques of springs and dampers from the states of motors and links."""
    K, D = np.diag(robot.joint_stiffness), np.diag(robot.joint_damping)
    return MatrixGain(np.hstack([K, D, -K, -D]))


def _stiffening_gears(robot: RobotModel) -> SymbolicVectorSystem:
    """What gears that stiffen under load give the links beyond their springs at rest, from both states."""
    state = MakeVectorContinuousVariable(2 * _STATE, "x")
    springs = robot.stiffening_gears
    assert springs is not None
    # Arithmetic with formulas sets the processor's flag for numbers that are none, of which numpy would warn.
    with np.errstate(invalid="ignore"):
        twist = np.array([Expression(state[i]) - state[_STATE + i] for i in range(NUM_JOINTS)], dtype=object)
        excess = springs.torque(twist) - springs.c_0 * twist
    return _function_of(state, list(excess))


def _function_of(x: np.ndarray, outputs: list[Expression]) -> SymbolicVectorSystem:
    # Without a state of its own such a system refuses to be integrated along with others: one that rests.
    idle = MakeVectorContinuousVariable(1, "idle")
    at_rest = np.array([Expression(0.0)], dtype=object)
    return SymbolicVectorSystem(input=x, state=idle, dynamics=at_rest, output=np.array(outputs, dtype=object))
