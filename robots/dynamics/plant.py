"""Puts a robot into a MultibodyPlant: rigid or elastic in gears or structure, nominal or as it truly is.

Elastic gears are two coaxial revolute joints in series: ``motor_i`` turns a massless rotor against the
inertia of the motor, ``deflection_i`` sprung and damped turns the link against the rotor. In these
coordinates the plant is the flexible-joint model without gyroscopic coupling of the rotors: link
positions are motor + deflection. What stiffens under load has in the plant the spring that it has at rest;
`PlantRobot.stiffening_torque` is what it has beyond that.

The same robot without its drive trains is a plant of the links alone, ``joint_i``, turned by the torques of
the gears; motors and gears are then a system beside it, which costs half as much to simulate.

An elastic structure has more sprung joints behind the gears: ``tilt_a_i``, ``tilt_b_i`` where a bearing
tilts across its axis, ``beam_i_...`` where a link is a beam.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import Capsule, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    LinearSpringDamper,
    MultibodyForces,
    RevoluteJoint,
    RevoluteSpring,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.framework import Context

from robots.description.counterbalance_spring import free_length
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import NUM_JOINTS, Joint, Link, RobotModel
from robots.drivetrain.stiffness import SpringRow
from robots.dynamics.elastic_structure import (
    SprungJoints,
    add_beam_link,
    add_bearing,
    add_rigid_link,
    link_inertia,
    massless,
)
from robots.dynamics.link_pictures import add_pictures
from robots.kinematics.error_kinematics import ErrorKinematics

ELASTICITIES = ("rigid", "joints", "structure")
_LINK_COLOR = Rgba(0.93, 0.45, 0.13, 1.0)
_BASE_COLOR = Rgba(0.35, 0.36, 0.38, 1.0)


@dataclass(frozen=True)
class PlantRobot:
    """The parts of a plant that belong to one robot, in joint order.

    Attributes:
        motors: the joints that the motors turn; those of the links where drive trains are not in the plant.
        deflections: the sprung joints of the gears, empty for a rigid robot and without drive trains.
        springs: the springs of these joints.
        tool: frame E.
        structure: the sprung joints of bearings and beams, empty without an elastic structure.
        structure_springs: the springs of these joints.
        has_counterbalance: whether a spring pulls at axis 2.
        stiffening_gears: the six characteristics of gears that yield and stiffen, None if all are linear.
        stiffening_structure: those of the joints of the structure, None if all are linear.
    """

    plant: MultibodyPlant
    motors: list[RevoluteJoint]
    deflections: list[RevoluteJoint]
    springs: list[RevoluteSpring]
    tool: Frame
    structure: list[RevoluteJoint] = field(default_factory=list)
    structure_springs: list[RevoluteSpring] = field(default_factory=list)
    has_counterbalance: bool = False
    stiffening_gears: SpringRow | None = None
    stiffening_structure: SpringRow | None = None

    @property
    def sprung(self) -> list[RevoluteJoint]:
        """All sprung joints: those of the gears, then those of the structure."""
        return [*self.deflections, *self.structure]

    @property
    def sprung_stiffness(self) -> np.ndarray:
        """The stiffness of all sprung joints at rest in N m / rad, in the order of `sprung`."""
        return np.array([spring.default_stiffness() for spring in (*self.springs, *self.structure_springs)])

    def tangent_stiffness(self, deflection: np.ndarray) -> np.ndarray:
        """The stiffness of all sprung joints in N m / rad at deflections in rad, in the order of `sprung`."""
        stiffness = self.sprung_stiffness
        for own, springs in self._stiffening():
            stiffness[own] = springs.stiffness(deflection[own])
        return stiffness

    def static_deflection(self, load: np.ndarray) -> np.ndarray:
        """How far all sprung joints yield, in rad, to loads in N m, in the order of `sprung`."""
        deflection = load / self.sprung_stiffness
        for own, springs in self._stiffening():
            deflection[own] = springs.deflection(load[own])
        return deflection

    def stiffening_torque(self, deflection: np.ndarray) -> np.ndarray:
        """What all sprung joints take beyond the linear springs of the plant, in N m.

        Args:
            deflection: in rad, in the order of `sprung`.
        """
        torque = np.zeros(len(deflection))
        for own, springs in self._stiffening():
            torque[own] = springs.torque(deflection[own]) - springs.c_0 * deflection[own]
        return torque

    def _stiffening(self) -> list[tuple[slice, SpringRow]]:
        """The springs that are not linear, and which of `sprung` they are."""
        gears = len(self.deflections)
        parts = (slice(gears), self.stiffening_gears), (slice(gears, None), self.stiffening_structure)
        return [(own, springs) for own, springs in parts if springs is not None]

    def motor_indices(self) -> list[int]:
        """Where motor positions, then motor velocities stand in the plant's state; 12 numbers."""
        num_positions = self.plant.num_positions()
        return [joint.position_start() for joint in self.motors] + [
            num_positions + joint.velocity_start() for joint in self.motors
        ]

    def link_positions(self, state: np.ndarray) -> np.ndarray:
        """Link positions in rad from plant states: motors and gears, without what the structure yields.

        Args:
            state: states or positions of the plant, shape (..., at least num_positions).

        Returns:
            Shape (..., 6).
        """
        q = state[..., [joint.position_start() for joint in self.motors]]
        if self.deflections:
            q = q + state[..., [joint.position_start() for joint in self.deflections]]
        return q

    def tool_poses(self, states: np.ndarray) -> np.ndarray:
        """Poses of the tool in the world.

        Args:
            states: states of the plant, shape (n, num_states).

        Returns:
            Homogeneous matrices, shape (n, 4, 4).
        """
        context = self.plant.CreateDefaultContext()
        poses = np.empty((len(states), 4, 4))
        for pose, state in zip(poses, states, strict=True):
            self.plant.SetPositionsAndVelocities(context, state)
            pose[:] = self.tool.CalcPoseInWorld(context).GetAsMatrix4()
        return poses

    def load(self, context: Context) -> np.ndarray:
        """What gravity and the counterbalance do to all joints in N m, shape (num_velocities,)."""
        if not self.has_counterbalance:
            return self.plant.CalcGravityGeneralizedForces(context)
        forces = MultibodyForces(self.plant)
        self.plant.CalcForceElementsContribution(context, forces)
        # Springs and dampers of joints act as generalized forces; the load is all that acts on bodies.
        forces.mutable_generalized_forces()[:] = 0.0
        return self.plant.CalcGeneralizedForces(context, forces)

    def set_at_rest(
        self,
        context: Context,
        theta: np.ndarray,
        wind_up: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    ) -> None:
        """Puts the motors at theta, still, with gears and structure sagging under load.

        Args:
            context: of the plant.
            theta: motor positions in rad, shape (6,).
            wind_up: where the gears are not in the plant, how far they yield in rad to torques in N m on
                their links with the motors at a position in rad, shape (6,) each; None for gears that do not.
        """
        positions = np.zeros(self.plant.num_positions())
        driven = [joint.position_start() for joint in self.motors]
        positions[driven] = theta
        self.plant.SetVelocities(context, np.zeros(self.plant.num_velocities()))
        self.plant.SetPositions(context, positions)
        rows = [joint.position_start() for joint in self.sprung]
        # The sag changes the lever arms by about a thousandth, so each pass gains three digits.
        for _ in range(6 if rows or wind_up else 0):
            load = self.load(context)
            positions[rows] = self.static_deflection(load[rows])
            if wind_up:
                positions[driven] = theta + wind_up(load[driven], theta)
            self.plant.SetPositions(context, positions)


def add_robot(
    plant: MultibodyPlant,
    robot: RobotModel,
    elasticity: str = "joints",
    payload: float = 0.0,
    errors: GeometricErrors | None = None,
    drive_trains: bool = True,
) -> PlantRobot:
    """Adds a robot to a plant that is not yet finalized. Capsules picture it if there is a SceneGraph.

    Viscous friction of the motors is the damping of their joints, eq. (2.63) of Probst (2024); Coulomb
    friction is left to the drives, because a continuous plant has none. A counterbalance is a spring between
    links 1 and 2, whatever is elastic.

    Args:
        elasticity: ``"rigid"``, ``"joints"`` for elastic gears, ``"structure"`` for bearings and beams too.
        payload: mass at the flange in kg.
        errors: how the true geometry differs from the nominal one; None for exact geometry.
        drive_trains: whether motors and gears are in the plant. Otherwise its joints are those of the links,
            its actuation the torques that the gears give them, and a base is left out, which stands still.

    Raises:
        ValueError: if the elasticity is unknown, the payload is more than the robot may carry, or an error
            has no place in this robot.
    """
    if elasticity not in ELASTICITIES:
        raise ValueError(f"elasticity must be one of {', '.join(ELASTICITIES)}, got '{elasticity}'")
    if not 0.0 <= payload <= robot.payload.largest_mass:
        raise ValueError(
            f"payload of {robot.name} must be between 0 and {robot.payload.largest_mass} kg, got {payload} kg"
        )
    if errors is not None:
        robot = ErrorKinematics(robot).robot_with_errors(errors.vector(robot))
    if drive_trains:
        before = _add_base(plant, robot).body_frame()
    else:
        before = plant.AddFrame(FixedOffsetFrame("base", plant.world_frame(), robot.base.pose()))
    motors, gears, structure = [], SprungJoints(), SprungJoints()
    bodies = []  # of each link the first body and the last
    for i, joint in enumerate(robot.joints):
        socket = plant.AddFrame(FixedOffsetFrame(f"socket_{i + 1}", before, joint.placement.pose()))
        carried = _payload_inertia(robot, payload) if i + 1 == NUM_JOINTS and payload > 0.0 else None
        link = robot.links[i]
        hinges = SprungJoints()
        if elasticity == "structure" and link.beam is not None:
            bodies.append(add_beam_link(plant, hinges, i + 1, link, carried))
        else:
            bodies.append(add_rigid_link(plant, i + 1, link, carried))
        first, last = bodies[-1]
        before = last.body_frame()
        driven = first
        if elasticity == "structure" and joint.tilting is not None:
            driven = plant.AddRigidBody(f"gear_{i + 1}", massless())
            add_bearing(plant, structure, i + 1, joint, driven, first)
        if elasticity != "rigid" and drive_trains:
            driven = _add_gear(plant, gears, i + 1, joint, driven)
        structure.extend(hinges)
        if drive_trains:
            motors.append(_add_motor(plant, robot, i, socket, driven))
        else:
            name = f"joint_{i + 1}"
            motors.append(plant.AddJoint(RevoluteJoint(name, socket, driven.body_frame(), joint.axis)))
            plant.AddJointActuator(name, motors[-1])
        following = robot.joints[i + 1].placement.translation if i + 1 < NUM_JOINTS else np.zeros(3)
        _picture_link(plant, bodies[-1], link, following)
    if robot.counterbalance is not None:
        _add_counterbalance(plant, robot, bodies[0][1], bodies[1][0])
    tool = plant.AddFrame(FixedOffsetFrame("tool", before, robot.tool.pose()))
    return PlantRobot(
        plant,
        motors,
        gears.joints,
        gears.springs,
        tool,
        structure.joints,
        structure.springs,
        robot.counterbalance is not None,
        None if elasticity == "rigid" or not drive_trains else robot.stiffening_gears,
        structure.stiffening,
    )


def _add_base(plant: MultibodyPlant, robot: RobotModel) -> RigidBody:
    base = plant.AddRigidBody("base", link_inertia(robot.base_link))
    plant.WeldFrames(plant.world_frame(), base.body_frame(), robot.base.pose())
    tip = robot.joints[0].placement.translation
    _picture_link(plant, (base, base), robot.base_link, tip, _BASE_COLOR)
    return base


def _add_gear(
    plant: MultibodyPlant, gears: SprungJoints, number: int, joint: Joint, driven: RigidBody
) -> RigidBody:
    """Puts the elastic gear before what it turns; returns the rotor."""
    rotor = plant.AddRigidBody(f"rotor_{number}", massless())
    frames, train = (rotor.body_frame(), driven.body_frame()), joint.drive_train
    gears.add(plant, f"deflection_{number}", frames, joint.axis, train.spring, train.damping)
    return rotor


def _add_motor(
    plant: MultibodyPlant, robot: RobotModel, i: int, socket: Frame, driven: RigidBody
) -> RevoluteJoint:
    joint, damping = robot.joints[i], float(robot.joint_viscous_friction[i])
    name = f"motor_{i + 1}"
    motor = plant.AddJoint(RevoluteJoint(name, socket, driven.body_frame(), joint.axis, damping))
    actuator = plant.AddJointActuator(name, motor)
    actuator.set_default_rotor_inertia(joint.drive_train.rotor_inertia)
    actuator.set_default_gear_ratio(joint.drive_train.ratio)
    return motor


def _add_counterbalance(plant: MultibodyPlant, robot: RobotModel, base: RigidBody, arm: RigidBody) -> None:
    spring, part = robot.counterbalance, robot.counterbalance_at_axis_2
    assert spring is not None
    assert part is not None
    plant.AddForceElement(
        LinearSpringDamper(
            base,
            spring.base_pivot,
            arm,
            spring.arm_pivot,
            free_length(part),
            spring.stiffness,
            spring.damping,
        )
    )


def _payload_inertia(robot: RobotModel, mass: float) -> SpatialInertia:
    share = mass / robot.payload.largest_mass
    return SpatialInertia.MakeFromCentralInertia(
        mass, robot.payload.center_of_mass, RotationalInertia(*map(float, share * robot.payload.inertia))
    )


def _picture_link(
    plant: MultibodyPlant,
    bodies: tuple[RigidBody, RigidBody],
    link: Link,
    tip: np.ndarray,
    color: Rgba = _LINK_COLOR,
) -> None:
    """Draws a link by its pictures or as a capsule, the halves of a beam apart so that one sees it bend."""
    if not plant.geometry_source_is_registered():
        return
    first, last = bodies
    if first is not last:
        _add_capsule(plant, first, np.zeros(3), 0.5 * tip, link.radius, color)
        _add_capsule(plant, last, 0.5 * tip, tip, link.radius, color)
    elif not add_pictures(plant, first, link, color):
        _add_capsule(plant, first, np.zeros(3), tip, link.radius, color)


def _add_capsule(
    plant: MultibodyPlant, body: RigidBody, start: np.ndarray, end: np.ndarray, radius: float, color: Rgba
) -> None:
    """Pictures a stretch of a link."""
    direction = np.asarray(end) - start
    length = float(np.linalg.norm(direction))
    if length < 1e-6:
        return
    R = RotationMatrix.MakeFromOneVector(direction / length, 2)
    X = RigidTransform(R, 0.5 * (start + end))
    plant.RegisterVisualGeometry(body, X, Capsule(radius, length), f"{body.name()}_capsule", color.rgba)
