"""Kinematics of a robot whose joints yield under its own weight and its load, and err with their angle."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from robots.description.joint_errors import JointErrors
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import add_robot
from robots.kinematics.forward import Kinematics

# A joint yields by a thousandth of a radian and its torque changes by a thousandth of that: three rounds
# leave less than 1e-11 rad.
_ROUNDS = 3
_DIFFERENCE = 1e-6  # rad; leaves 1e-6 of a derivative that is itself a thousandth


class CompliantKinematics:
    """Tool poses for motor positions theta: the links stand at theta + compliance * gravity torque.

    The gravity torques are those of the robot's masses and the payload where the links stand, so that the
    deflection is that of the elastic robot at rest. What a calibration has found of errors of the joints
    adds to that. The methods have the shapes and errors of `Kinematics`.
    The Jacobian is that of the motors: it knows that the deflection changes along the way, which is a
    thousandth of the motion and would let a law that integrates velocities lag by tenths of a millimetre.
    """

    def __init__(self, robot: RobotModel, payload: float = 0.0) -> None:
        """Builds the rigid plant that tells the torques.

        Args:
            robot: geometry, masses and compliances.
            payload: mass at the flange in kg.

        Raises:
            ValueError: if the robot may not carry the payload.
        """
        self.robot = robot
        self._rigid = Kinematics(robot)
        self._compliance = robot.compliance
        found = robot.calibration.joint_errors
        self._errors, self._values = (
            JointErrors(tuple(found), robot.gear_ratio),
            np.array(list(found.values())),
        )
        self._plant = MultibodyPlant(0.0)
        self._parts = add_robot(self._plant, robot, "rigid", payload)
        self._plant.Finalize()
        # Scratch memory only: written before every use.
        self._context = self._plant.CreateDefaultContext()

    def gravity_torque(self, q: np.ndarray) -> np.ndarray:
        """What gravity and a counterbalance do at link positions in rad, in N m, (..., 6) -> (..., 6)."""
        q = np.asarray(q, dtype=float)
        if q.shape[-1:] != (NUM_JOINTS,):
            raise ValueError(f"joint positions must have the shape (..., {NUM_JOINTS}), got {q.shape}")
        if q.ndim == 1:
            self._plant.SetPositions(self._context, q)
            return self._parts.load(self._context)
        flat = [self.gravity_torque(each) for each in q.reshape(-1, NUM_JOINTS)]
        return np.array(flat).reshape(q.shape)

    def link_positions(self, theta: np.ndarray) -> np.ndarray:
        """Where the links stand at motor positions in rad, (..., 6) -> (..., 6)."""
        true = theta + self._errors.added(theta, self._values) if len(self._values) else theta
        q = true
        for _ in range(_ROUNDS if self._compliance.any() else 0):
            q = true + self._compliance * self.gravity_torque(q)
        return q

    def forward(self, q: np.ndarray) -> np.ndarray:
        """Tool poses X_WE at motor positions q in rad, (..., 6) -> (..., 4, 4)."""
        return self._rigid.forward(self.link_positions(q))

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Geometric Jacobians by motor positions q in rad, rotation first, (..., 6) -> (..., 6, 6)."""
        return self.forward_and_jacobian(q)[1]

    def rows_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """`forward_and_jacobian` at one q (6,), with the first three rows of the pose, (3, 4)."""
        X, J = self.forward_and_jacobian(q)
        return X[:3], np.ascontiguousarray(J)

    def forward_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What `forward` and `jacobian` return, computed together."""
        links = self.link_positions(q)
        X, J = self._rigid.forward_and_jacobian(links)
        if len(self._values):
            J = J + J @ _slopes(self._errors, q, self._values)
        return X, J @ self._links_by_motors(links) if self._compliance.any() else J

    def _links_by_motors(self, q: np.ndarray) -> np.ndarray:
        """d(link positions) / d(motor positions), first order in the compliance, (..., 6) -> (..., 6, 6)."""
        torque = self.gravity_torque(q)
        stiffening = [
            (self.gravity_torque(q + step) - torque) / _DIFFERENCE
            for step in _DIFFERENCE * np.eye(NUM_JOINTS)
        ]
        return np.eye(NUM_JOINTS) + self._compliance[:, None] * np.stack(stiffening, axis=-1)


def controller_kinematics(robot: RobotModel, payload: float = 0.0) -> Kinematics | CompliantKinematics:
    """The kinematics that a controller computes with: rigid, or with what a calibration found of joints."""
    return CompliantKinematics(robot, payload) if robot.has_joint_calibration else Kinematics(robot)


def _slopes(errors: JointErrors, q: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Derivatives of errors by joint positions, (..., 6) -> (..., 6, 6)."""
    flat = [errors.slope(each, values) for each in q.reshape(-1, NUM_JOINTS)]
    return np.array(flat).reshape(*q.shape, NUM_JOINTS)
