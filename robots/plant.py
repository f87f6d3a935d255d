"""Puts a robot into a MultibodyPlant: rigid or with elastic gears, nominal or with its true geometry.

Elastic gears are two coaxial revolute joints in series: ``motor_i`` turns a massless rotor against the
inertia of the motor, ``deflection_i`` sprung and damped turns the link against the rotor. In these
coordinates the plant is the flexible-joint model without gyroscopic coupling of the rotors: link
positions are motor + deflection.
"""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Capsule, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    RevoluteJoint,
    RevoluteSpring,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import Context

from robots.error_kinematics import ErrorKinematics
from robots.geometric_errors import GeometricErrors
from robots.model import NUM_JOINTS, Link, RobotModel

ELASTICITIES = ("rigid", "joints")
_LINK_COLOR = Rgba(0.93, 0.45, 0.13, 1.0)
_BASE_COLOR = Rgba(0.35, 0.36, 0.38, 1.0)


@dataclass(frozen=True)
class PlantRobot:
    """The parts of a plant that belong to one robot, in joint order.

    Attributes:
        deflections: the sprung joints, empty for a rigid robot.
        springs: the springs of these joints.
        tool: frame E.
    """

    plant: MultibodyPlant
    motors: list[RevoluteJoint]
    deflections: list[RevoluteJoint]
    springs: list[RevoluteSpring]
    tool: Frame

    def motor_indices(self) -> list[int]:
        """Where motor positions, then motor velocities stand in the plant's state; 12 numbers."""
        num_positions = self.plant.num_positions()
        return [joint.position_start() for joint in self.motors] + [
            num_positions + joint.velocity_start() for joint in self.motors
        ]

    def link_positions(self, state: np.ndarray) -> np.ndarray:
        """Link positions in rad from plant states.

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

    def set_at_rest(self, context: Context, theta: np.ndarray) -> None:
        """Puts the motors at theta (rad, shape (6,)), still, with the gears sagging under gravity."""
        positions = np.zeros(self.plant.num_positions())
        positions[[joint.position_start() for joint in self.motors]] = theta
        self.plant.SetVelocities(context, np.zeros(self.plant.num_velocities()))
        self.plant.SetPositions(context, positions)
        rows = [joint.position_start() for joint in self.deflections]
        stiffness = np.array([spring.default_stiffness() for spring in self.springs])
        # The sag changes the lever arms by about a thousandth, so each pass gains three digits.
        for _ in range(6 if rows else 0):
            torque = self.plant.CalcGravityGeneralizedForces(context)
            positions[rows] = torque[rows] / stiffness
            self.plant.SetPositions(context, positions)


def add_robot(
    plant: MultibodyPlant,
    robot: RobotModel,
    elasticity: str = "joints",
    payload: float = 0.0,
    errors: GeometricErrors | None = None,
) -> PlantRobot:
    """Adds a robot to a plant that is not yet finalized. Capsules picture it if there is a SceneGraph.

    Viscous friction of the motors is the damping of their joints, eq. (2.63) of Probst (2024); Coulomb
    friction is left to the drives, because a continuous plant has none.

    Args:
        elasticity: ``"rigid"`` or ``"joints"``.
        payload: mass at the flange in kg.
        errors: how the true geometry differs from the nominal one; None for exact geometry.

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
    parent = plant.AddRigidBody("base", _inertia(robot.base_link))
    plant.WeldFrames(plant.world_frame(), parent.body_frame(), robot.base.pose())
    _add_capsule(
        plant, parent, np.zeros(3), robot.joints[0].placement.translation, robot.base_link.radius, _BASE_COLOR
    )
    motors, deflections, springs = [], [], []
    for i, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True), 1):
        inertia = _inertia(link)
        if i == NUM_JOINTS and payload > 0.0:
            inertia += _payload_inertia(robot, payload)
        body = plant.AddRigidBody(f"link_{i}", inertia)
        socket = plant.AddFrame(FixedOffsetFrame(f"socket_{i}", parent.body_frame(), joint.placement.pose()))
        damping = float(robot.joint_viscous_friction[i - 1])
        train = joint.drive_train
        driven = body
        if elasticity == "joints":
            driven = plant.AddRigidBody(f"rotor_{i}", _massless())
            deflection = plant.AddJoint(
                RevoluteJoint(
                    f"deflection_{i}", driven.body_frame(), body.body_frame(), joint.axis, train.damping
                )
            )
            springs.append(plant.AddForceElement(RevoluteSpring(deflection, 0.0, train.stiffness)))
            deflections.append(deflection)
        motor = plant.AddJoint(RevoluteJoint(f"motor_{i}", socket, driven.body_frame(), joint.axis, damping))
        actuator = plant.AddJointActuator(f"motor_{i}", motor)
        actuator.set_default_rotor_inertia(train.rotor_inertia)
        actuator.set_default_gear_ratio(train.ratio)
        motors.append(motor)
        if i < NUM_JOINTS:
            tip = robot.joints[i].placement.translation
            _add_capsule(plant, body, np.zeros(3), tip, link.radius, _LINK_COLOR)
        parent = body
    tool = plant.AddFrame(FixedOffsetFrame("tool", parent.body_frame(), robot.tool.pose()))
    return PlantRobot(plant, motors, deflections, springs, tool)


def _inertia(link: Link) -> SpatialInertia:
    return SpatialInertia.MakeFromCentralInertia(
        link.mass, link.center_of_mass, RotationalInertia(*map(float, link.inertia))
    )


def _payload_inertia(robot: RobotModel, mass: float) -> SpatialInertia:
    share = mass / robot.payload.largest_mass
    return SpatialInertia.MakeFromCentralInertia(
        mass, robot.payload.center_of_mass, RotationalInertia(*map(float, share * robot.payload.inertia))
    )


def _massless() -> SpatialInertia:
    return SpatialInertia(0.0, np.zeros(3), UnitInertia(0.0, 0.0, 0.0), skip_validity_check=True)


def _add_capsule(
    plant: MultibodyPlant, body: RigidBody, start: np.ndarray, end: np.ndarray, radius: float, color: Rgba
) -> None:
    """Pictures a stretch of a link; does nothing in a plant without a SceneGraph."""
    if not plant.geometry_source_is_registered():
        return
    direction = np.asarray(end) - start
    length = float(np.linalg.norm(direction))
    if length < 1e-6:
        return
    R = RotationMatrix.MakeFromOneVector(direction / length, 2)
    X = RigidTransform(R, 0.5 * (start + end))
    plant.RegisterVisualGeometry(body, X, Capsule(radius, length), f"{body.name()}_capsule", color.rgba)
