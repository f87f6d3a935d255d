"""Natural frequencies, damping and shapes of an elastic robot about rest, with its motors held.

The motors of an industrial robot are held by stiff drives, so what swings are the sprung joints q_e behind
them: M_ee q_e'' + D q_e' + (C + G) q_e = 0, where M_ee is their part of the mass matrix, C and D their
springs and dampers, and G the stiffness of gravity and counterbalance at the deformed rest. This is the
linear part of Reiner (2010), eq. (2.38), for the elastic coordinates.
"""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.linalg import eigh

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.load_stiffness import load_stiffness
from robots.dynamics.plant import add_robot
from robots.kinematics.arm_structure import seen_from_base
from robots.kinematics.forward import Kinematics
from robots.kinematics.workspace import shoulder

_ALONG = 0.9  # cosine of an axis that points nearly along a direction
_STEPS = 61  # of joints 2 and 3, among which the longest reach is looked for
_UNBALANCED = 1e-6  # of the load; an arm that its springs can carry comes to rest far better


@dataclass(frozen=True)
class Modes:
    """The modes of a robot in one configuration, the slowest first; n sprung joints have n modes."""

    joints: tuple[str, ...]  # the names of the sprung joints
    angular_frequency: np.ndarray  # (n,) rad/s, undamped
    damping_ratio: np.ndarray  # (n,), above one where nothing swings
    shape: np.ndarray  # (n, n), a column per mode: deflections of the joints, normed to unit modal mass
    rest: np.ndarray  # (n,) rad, deflections of the joints at rest
    energy_share: np.ndarray  # (n, n), a column per mode: each spring's share of the strain energy
    tip: np.ndarray  # (6, n), a column per mode: how the tool turns (rad) and moves (m) in the world

    @property
    def frequency_hz(self) -> np.ndarray:
        """Undamped natural frequencies in Hz, shape (n,)."""
        return self.angular_frequency / (2.0 * np.pi)

    def dominant_joints(self, mode: int, count: int = 3) -> list[tuple[str, float]]:
        """The joints that store most of a mode's strain energy, with their shares, the largest first."""
        share = self.energy_share[:, mode]
        return [(self.joints[i], float(share[i])) for i in np.argsort(share)[::-1][:count]]


class ModalAnalysis:
    """Finds the modes of one robot, in one configuration after the other."""

    def __init__(self, robot: RobotModel, elasticity: str = "structure", payload: float = 0.0) -> None:
        """Builds the plant.

        Args:
            robot: what swings.
            elasticity: ``"joints"`` or ``"structure"``.
            payload: mass at the flange in kg.

        Raises:
            ValueError: if the elasticity is unknown or rigid, or the robot may not carry the payload.
        """
        if elasticity == "rigid":
            raise ValueError("modes: a rigid robot has none; elasticity must be joints or structure")
        self._robot = robot
        self._plant = MultibodyPlant(0.0)
        self._parts = add_robot(self._plant, robot, elasticity, payload)
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        sprung = self._parts.sprung
        self.joints = tuple(joint.name() for joint in sprung)
        self._rows = [joint.position_start() for joint in sprung]
        self._damping = np.array([joint.default_damping() for joint in sprung])

    def at(self, theta: np.ndarray) -> Modes:
        """The modes with the motors at theta (rad, shape (6,)).

        Raises:
            ValueError: if theta is not six finite numbers, or the arm is too soft to carry itself there.
        """
        theta = np.asarray(theta, dtype=float)
        if theta.shape != (NUM_JOINTS,) or not np.isfinite(theta).all():
            raise ValueError(f"modes: a configuration must be {NUM_JOINTS} finite angles, got {theta}")
        self._parts.set_at_rest(self._context, theta)
        rest = self._plant.GetPositions(self._context)
        load, deflection = self._parts.load(self._context)[self._rows], rest[self._rows]
        stiffness = self._parts.tangent_stiffness(deflection)
        M = self._plant.CalcMassMatrix(self._context)[np.ix_(self._rows, self._rows)]
        K = np.diag(stiffness) + load_stiffness(self._parts, self._context, self._rows)
        squared, shape = eigh(K, M)
        unbalanced = stiffness * (self._parts.static_deflection(load) - deflection)
        is_at_rest = np.abs(unbalanced).max() <= _UNBALANCED * np.abs(load).max()
        if not (is_at_rest and squared[0] > 0.0):
            raise ValueError(
                f"modes of {self._robot.name}: too soft to carry itself with the motors at "
                f"{np.rad2deg(theta).round(1).tolist()} deg"
            )
        frequency = np.sqrt(squared)
        # Small dampers couple the modes by what is off the diagonal in second order only.
        damping = np.einsum("ij,i,ij->j", shape, self._damping, shape)
        strain = stiffness[:, None] * shape**2
        world = self._plant.world_frame()
        J = self._plant.CalcJacobianSpatialVelocity(
            self._context, JacobianWrtVariable.kV, self._parts.tool, np.zeros(3), world, world
        )
        return Modes(
            self.joints,
            frequency,
            0.5 * damping / frequency,
            shape,
            deflection,
            strain / strain.sum(0),
            J[:, self._rows] @ shape,
        )


def stretched(robot: RobotModel) -> np.ndarray:
    """Upper arm and forearm level ahead of the robot, as far as its limits allow; rad, shape (6,).

    This is the longest reach. There the load has the longest levers, so the modes are slowest. Of an arm
    whose axes 2 and 3 do not point along y at zero it is the position with the tool farthest from axis 1.
    """
    axes, offsets, _ = seen_from_base(robot)
    if np.abs(axes[1:3, 1]).min() < _ALONG:
        return _farthest(robot)
    wrist = offsets[3] + offsets[4]
    upper_arm = np.arctan2(offsets[2, 0], offsets[2, 2])  # from z towards x, at zero joint angles
    forearm = np.arctan2(wrist[0], wrist[2])
    q = np.zeros(NUM_JOINTS)
    sign_2, sign_3 = np.sign(axes[1:3, 1])
    q[1] = np.clip(sign_2 * (0.5 * np.pi - upper_arm), robot.lower[1], robot.upper[1])
    q[2] = sign_3 * (0.5 * np.pi - forearm - sign_2 * q[1])
    return np.clip(q, robot.lower, robot.upper)


def _farthest(robot: RobotModel) -> np.ndarray:
    """The positions of joints 2 and 3 with the tool farthest from axis 1, all others at or next to zero."""
    ranges = [np.linspace(max(robot.lower[i], -np.pi), min(robot.upper[i], np.pi), _STEPS) for i in (1, 2)]
    second, third = (each.ravel() for each in np.meshgrid(*ranges, indexing="ij"))
    q = np.tile(np.clip(0.0, robot.lower, robot.upper), (len(second), 1))
    q[:, 1], q[:, 2] = second, third
    origin, axis = shoulder(robot)
    away = np.linalg.norm(np.cross(Kinematics(robot).forward(q)[:, :3, 3] - origin, axis), axis=1)
    return q[int(np.argmax(away))]
