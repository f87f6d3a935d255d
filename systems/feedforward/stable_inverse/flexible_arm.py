"""All of an elastic robot at once: what its motion lacks to obey the equations of gears and structure."""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import add_robot

_WRIST_AXES = (3, 4, 5)
_ROUNDS = 4  # the sag changes the stiffness by about a thousandth, so each one gains three digits
_DIFFERENCE = 1e-6  # rad, of static torques that change over radians


@dataclass(frozen=True)
class Pencil:
    """Rows M s^2 + D s + K of equations linear in n positions, shape (..., n, n) each."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray


class FlexibleArm:
    """A robot with elastic gears and structure, moved as prescribed in all its coordinates.

    As many equations as coordinates: a point is on its path (three), the links behind the gears of the wrist
    are where those of a rigid robot would be (three), and no torque acts on sprung joints but those of spring
    and damper. With the orientation of the tip in place of the wrist's links the equations were singular
    where the wrist is.
    """

    def __init__(self, robot: RobotModel, payload: float = 0.0, point: str = "tip") -> None:
        """Builds the plant, which is the controller's own.

        Args:
            robot: the robot as the controller knows it.
            payload: mass at the flange in kg.
            point: ``"tip"``, or ``"wrist"`` where axes 4, 5 and 6 meet.

        Raises:
            ValueError: if the robot may not carry the payload, or its gears are more than springs.
        """
        if robot.drive_trains is not None:
            raise ValueError(
                f"feedforward stable: the drive trains of {robot.name} have parts beyond springs, dampers "
                "and friction, which have no stable inverse here"
            )
        self._plant = MultibodyPlant(0.0)
        self._parts = add_robot(self._plant, robot, "structure", payload)
        self._plant.Finalize()
        wrist = self._plant.GetBodyByName("link_5").body_frame()
        self._point = self._parts.tool if point == "tip" else wrist
        # Scratch memory only: written before every use.
        self._context, self._forces = self._plant.CreateDefaultContext(), MultibodyForces(self._plant)
        self.size = self._plant.num_positions()
        self.motors = np.array([joint.position_start() for joint in self._parts.motors])
        self.sprung = np.array([joint.position_start() for joint in self._parts.sprung])
        self._gears = self.sprung[:NUM_JOINTS]
        # Which motor and which gear turn the links of the wrist.
        self._wrist = np.zeros((3, self.size))
        for row, axis in enumerate(_WRIST_AXES):
            self._wrist[row, [self.motors[axis], self._gears[axis]]] = 1.0

    def at_rest_with_point(self, q: np.ndarray) -> np.ndarray:
        """All positions in rad at rest, the point and the wrist's links where rigid joints q have them."""
        self._parts.set_at_rest(self._context, q)
        positions, still = self._plant.GetPositions(self._context), np.zeros(self.size)
        stiffness, wanted = self.pencil(positions, still, still).stiffness, self.rigid_place(q)
        for _ in range(_ROUNDS):
            motion = (positions[None], still[None], still[None])
            positions = positions - np.linalg.solve(
                stiffness, self.residuals(motion, q[None], wanted[None])[0][0]
            )
        return positions

    def torques(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> np.ndarray:
        """What has to act on every joint beside springs, dampers and viscous friction, in N m, (size,)."""
        self._plant.SetPositionsAndVelocities(self._context, np.concatenate([q, v]))
        self._plant.CalcForceElementsContribution(self._context, self._forces)
        torques = self._plant.CalcInverseDynamics(self._context, vdot, self._forces)
        torques[self.sprung] += self._parts.stiffening_torque(q[self.sprung])
        return torques

    def place(self, q: np.ndarray) -> np.ndarray:
        """Where the point is in m, shape (3,)."""
        self._plant.SetPositions(self._context, q)
        return self._point.CalcPoseInWorld(self._context).translation()

    def rigid_place(self, q: np.ndarray) -> np.ndarray:
        """Where it is with rigid joints at q (rad, shape (6,)), in m, shape (3,)."""
        positions = np.zeros(self.size)
        positions[self.motors] = q
        return self.place(positions)

    def mobility(self, q: np.ndarray) -> float:
        """How well axes 1 to 3 of a rigid robot at q (rad, shape (6,)) move the point in every direction.

        The smallest singular value over the largest: zero where the arm is stretched, or the point on axis 1.
        """
        positions = np.zeros(self.size)
        positions[self.motors] = q
        self._plant.SetPositions(self._context, positions)
        values = np.linalg.svd(self._lever()[:, self.motors[:3]], compute_uv=False)
        return float(values[-1] / values[0])

    def residuals(
        self, motion: tuple[np.ndarray, np.ndarray, np.ndarray], q: np.ndarray, wanted: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What a motion lacks.

        Args:
            motion: positions in rad and their two derivatives, shape (samples, size) each.
            q: of the rigid joints in rad, shape (samples, 6).
            wanted: where the point shall be in m, shape (samples, 3).

        Returns:
            The equations in m, rad and N m, shape (samples, size): point, wrist, sprung joints; and the
            torques of the motors in N m without Coulomb friction, shape (samples, 6).
        """
        equations, torques = np.empty((len(q), self.size)), np.empty((len(q), NUM_JOINTS))
        for row, torque, moment, place in zip(
            equations, torques, zip(*motion, strict=True), wanted, strict=True
        ):
            needed = self.torques(*moment)
            row[6:], torque[:] = needed[self.sprung], needed[self.motors]
            row[:3] = self.place(moment[0]) - place
        equations[:, 3:6] = motion[0] @ self._wrist.T - q[:, _WRIST_AXES]
        return equations, torques

    def pencil(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> Pencil:
        """The same equations, linear about a motion at one instant; shape (size,) each."""
        n = self.size
        stiffness, damping = np.empty((n, n)), np.empty((n, n))
        for column, step in enumerate(_DIFFERENCE * np.eye(n)):
            change = self.torques(q + step, v, vdot) - self.torques(q - step, v, vdot)
            stiffness[:, column] = change / (2.0 * _DIFFERENCE)
            # Torques are of second degree in velocities: any step will do.
            damping[:, column] = 0.5 * (
                self.torques(q, v + step / _DIFFERENCE, vdot) - self.torques(q, v - step / _DIFFERENCE, vdot)
            )
        self._plant.SetPositions(self._context, q)
        mass = self._plant.CalcMassMatrix(self._context)
        kinematic = np.zeros((6, n))
        return Pencil(
            np.vstack([kinematic, mass[self.sprung]]),
            np.vstack([kinematic, damping[self.sprung]]),
            np.vstack([self._lever(), self._wrist, stiffness[self.sprung]]),
        )

    def _lever(self) -> np.ndarray:
        """How all joints move the point, in m/rad, shape (3, size)."""
        world = self._plant.world_frame()
        return self._plant.CalcJacobianTranslationalVelocity(
            self._context, JacobianWrtVariable.kV, self._point, np.zeros(3), world, world
        )
