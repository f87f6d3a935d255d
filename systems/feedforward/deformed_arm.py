"""The arm behind the gears: what loads its bearings and beams, and where its tip is when they yield."""

import math

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from robots.description.model import RobotModel
from robots.dynamics.plant import add_robot
from systems.feedforward.joint_motion import JointReference


class DeformedArm:
    """A robot with elastic structure, moved as prescribed: joints q as seen behind the gears, structure e."""

    def __init__(self, robot: RobotModel, payload: float = 0.0) -> None:
        """Builds the plant, which is the controller's own.

        Args:
            robot: the robot as the controller knows it.
            payload: mass at the flange in kg.

        Raises:
            ValueError: if the robot may not carry the payload, or has neither bearings nor beams that yield.
        """
        plant = self._plant = MultibodyPlant(0.0)
        parts = self._parts = add_robot(plant, robot, "structure", payload)
        plant.Finalize()
        if not parts.structure:
            raise ValueError(f"feedforward elastic_structure: no bearing or beam of {robot.name} yields")
        self.size = len(parts.structure)
        self.stiffness = np.array([spring.default_stiffness() for spring in parts.structure_springs])
        self.damping = np.array([joint.default_damping() for joint in parts.structure])
        self.stiffening = parts.stiffening_structure
        # All motion of the gears' far side is given to the motors; the gears stay at zero.
        self._joints = np.array([joint.position_start() for joint in parts.motors])
        self._gears = np.array([joint.velocity_start() for joint in parts.deflections])
        self._structure = np.array([joint.position_start() for joint in parts.structure])
        # Scratch memory only: written before every use.
        self._context, self._forces = plant.CreateDefaultContext(), MultibodyForces(plant)
        n = plant.num_positions()
        self._state, self._acceleration = np.zeros(2 * n), np.zeros(n)
        # The sockets of axes 2 and 3, and the point where axes 4, 5 and 6 meet.
        wrist = plant.GetBodyByName("link_5").body_frame()
        self._landmarks = [parts.motors[1].frame_on_parent(), parts.motors[2].frame_on_parent(), wrist]
        self._axes = robot.axes
        socket = parts.motors[0].frame_on_parent().CalcPoseInWorld(self._context)
        self._axis_1, self._p_W1 = socket.rotation().multiply(robot.axes[0]), socket.translation()

    def section_torques(self, reference: JointReference) -> np.ndarray:
        """What loads bearings and beams of an arm that does not yield, in N m, shape (size,).

        They are the rows M_ea q'' + h_e* of its inverse dynamics, Reiner (2010) eq. (3.76).
        """
        still = np.zeros(self.size)
        return self._inverse_dynamics(reference, (still, still, still))[self._structure]

    def gear_load(
        self, reference: JointReference, structure: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> np.ndarray:
        """What the gears carry when the arm moves and yields so, in N m, (6,); (3.91), corrected.

        Args:
            reference: of the joints behind the gears.
            structure: deflections in rad and their two derivatives, shape (size,) each.
        """
        return self._inverse_dynamics(reference, structure)[self._gears]

    def pose(self, q: np.ndarray, deflection: np.ndarray) -> np.ndarray:
        """The pose of the tool in the world, shape (3, 4)."""
        self._set(q, deflection)
        return self._parts.tool.CalcPoseInWorld(self._context).GetAsMatrix34()

    def pose_and_jacobian(self, q: np.ndarray, deflection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pose of the tool, shape (3, 4), and its geometric Jacobian by the joints, shape (6, 6)."""
        X_WE, world = self.pose(q, deflection), self._plant.world_frame()
        J = self._plant.CalcJacobianSpatialVelocity(
            self._context, JacobianWrtVariable.kV, self._parts.tool, np.zeros(3), world, world
        )
        return X_WE, J[:, self._joints]

    def posture(self) -> tuple[float, float]:
        """How near the arm is to singular, in the positions that were asked for last.

        Returns:
            How far in m the wrist is from axis 1, and the sine of the angle between upper arm and forearm.
        """
        shoulder, elbow, wrist = (
            frame.CalcPoseInWorld(self._context).translation() for frame in self._landmarks
        )
        arm, upper_arm, forearm = wrist - self._p_W1, elbow - shoulder, wrist - elbow
        squared = float(arm @ arm) - float(self._axis_1 @ arm) ** 2
        lengths = float(upper_arm @ upper_arm) * float(forearm @ forearm)
        sine_squared = 1.0 - float(upper_arm @ forearm) ** 2 / lengths
        return math.sqrt(max(0.0, squared)), math.sqrt(max(0.0, sine_squared))

    def rigid_elbow(self, q: np.ndarray) -> np.ndarray:
        """Where axis 3 of an arm that does not yield is, in m in the world, shape (3,)."""
        self._set(q, np.zeros(self.size))
        return self._landmarks[1].CalcPoseInWorld(self._context).translation()

    def lever(
        self, joint: int, q: np.ndarray, deflection: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The axis of joint 0, 1 or 2 as a unit vector, a point on it, axis 3 and the tip; (3,) each."""
        self._set(q, deflection)
        socket, elbow, tool = (
            frame.CalcPoseInWorld(self._context)
            for frame in (self._parts.motors[joint].frame_on_parent(), self._landmarks[1], self._parts.tool)
        )
        axis = socket.rotation().multiply(self._axes[joint])
        return axis, socket.translation(), elbow.translation(), tool.translation()

    def _set(self, q: np.ndarray, deflection: np.ndarray) -> None:
        positions = self._state[: len(self._acceleration)]
        positions[self._joints], positions[self._structure] = q, deflection
        self._plant.SetPositions(self._context, positions)

    def _inverse_dynamics(
        self, reference: JointReference, structure: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> np.ndarray:
        n = len(self._acceleration)
        for place, of_joints, of_structure in (
            (self._state[:n], reference.position, structure[0]),
            (self._state[n:], reference.velocity, structure[1]),
            (self._acceleration, reference.acceleration, structure[2]),
        ):
            place[self._joints], place[self._structure] = of_joints, of_structure
        self._plant.SetPositionsAndVelocities(self._context, self._state)
        self._plant.CalcForceElementsContribution(self._context, self._forces)
        return self._plant.CalcInverseDynamics(self._context, self._acceleration, self._forces)
