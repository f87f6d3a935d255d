"""What all feedforwards share: ports, the joint reference with its derivatives, and the load of the links."""

from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from robots.compliant_kinematics import CompliantKinematics
from robots.inverse_kinematics import JointLimitError, UnreachableError
from robots.kinematics import Kinematics, robust_solve
from robots.model import NUM_JOINTS, RobotModel
from robots.newton_inverse import inverse_kinematics
from robots.plant import add_robot
from systems.samples import JointSample

_SMALL_TURN = 1e-5  # s times the joint velocity: over which the change of the Jacobian is measured
_NOTHING = np.zeros(NUM_JOINTS)


@dataclass
class FeedforwardConfig:
    """Which inverse model runs beside the law; read from a scenario file."""

    kind: str = "none"  # none, rigid or flexible_joint
    stiffness_error: float = (
        0.0  # by which share the model's stiffness and damping are larger than the robot's
    )
    inertia_error: float = 0.0  # the same for the masses and inertias


@dataclass(frozen=True)
class JointReference:
    """Where the links are to be, all in rad and s, shape (6,) each."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True)
class Drive:
    """What motors shall do so that the links follow, shape (6,) each."""

    deflection: np.ndarray  # rad, of the links against the motors
    deflection_rate: np.ndarray  # rad/s
    torque: np.ndarray  # N m, joint side, all that the motors give
    memory: np.ndarray


class Feedforward(LeafSystem):
    """The frame of an inverse model; a model adds `_drive`.

    Ports:
        in  ``X_WE_desired``        RigidTransform, the wanted pose at t + preview
        in  ``V_WE_desired``        vector 6, its spatial velocity
        in  ``A_WE_desired``        vector 6, its spatial acceleration
        in  ``joint_sample``        JointSample, whose positions choose the branch at the beginning
        out ``position_offset``     vector 6 in rad, what a law's commands for the links lack to be motors'
        out ``velocity_offset``     vector 6 in rad/s, likewise
        out ``torque_feedforward``  vector 6 in N m, joint side, beyond the drives' gravity compensation

    The offsets are added to the commands of any law: the law leads the links along the path and corrects what
    the model leaves. Where a calibrated robot knows its compliances, the law's commands contain the
    deflection under gravity already, and the offsets only the rest. Out of reach the outputs are zero.
    """

    memory_size = 0  # how many numbers a model remembers beside the positions

    def __init__(
        self, robot: RobotModel, config: FeedforwardConfig, period: float, payload: float = 0.0
    ) -> None:
        """Builds the rigid model.

        Args:
            robot: the robot as the controller knows it.
            config: how wrong the model is.
            period: tick in s.
            payload: mass at the flange in kg.

        Raises:
            ValueError: if an error makes a stiffness or a mass vanish.
        """
        super().__init__()
        for label in ("stiffness_error", "inertia_error"):
            if not getattr(config, label) > -1.0:
                raise ValueError(f"feedforward: {label} must be above -1, got {getattr(config, label)}")
        self._period, self._inertia = period, 1.0 + config.inertia_error
        self._stiffness = (1.0 + config.stiffness_error) * robot.joint_stiffness
        self._damping = (1.0 + config.stiffness_error) * robot.joint_damping
        self._rotor, self._viscous = robot.reflected_inertia, robot.joint_viscous_friction
        self._coulomb, self._coulomb_velocity = robot.joint_coulomb_friction, robot.coulomb_velocity
        self._kinematics = Kinematics(robot)
        # Where the links have to be: the law alone cares for their sag under gravity, if it knows of it.
        self._inverse = inverse_kinematics(robot, payload)
        self._sag = CompliantKinematics(robot, payload) if robot.compliance.any() else None
        self._compliance = robot.compliance
        self._plant = MultibodyPlant(0.0)
        add_robot(self._plant, robot, "rigid", payload)
        self._plant.Finalize()
        # Scratch memory only: written before every use.
        self._context, self._forces = self._plant.CreateDefaultContext(), MultibodyForces(self._plant)
        self._X_WD = self.DeclareAbstractInputPort("X_WE_desired", Value(RigidTransform()))
        self._V_WD = self.DeclareVectorInputPort("V_WE_desired", 6)
        self._A_WD = self.DeclareVectorInputPort("A_WE_desired", 6)
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        for name in ("position_offset", "velocity_offset", "torque_feedforward"):
            self.DeclareStateOutputPort(name, self.DeclareDiscreteState(NUM_JOINTS))
        self._last = self.DeclareDiscreteState(np.full(NUM_JOINTS, np.nan))
        self._last_torque = self.DeclareDiscreteState(np.full(NUM_JOINTS, np.nan))
        self._memory = self.DeclareDiscreteState(np.full(max(1, self.memory_size), np.nan))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._tick)

    def _drive(self, reference: JointReference, load: np.ndarray, memory: np.ndarray) -> Drive:
        """What the motors shall do.

        Args:
            reference: of the links.
            load: torques in N m that move the links so, without rotors and friction, shape (6,).
            memory: of the last tick, NaN at the first one.
        """
        raise NotImplementedError

    def _tick(self, context: Context, discrete_state: DiscreteValues) -> None:
        last = context.get_discrete_state(self._last).value()
        if np.isnan(last[0]):
            last = self._joints.Eval(context).position
        try:
            reference = self._reference(context, last)
        except (UnreachableError, JointLimitError):
            for index in range(3):
                discrete_state.set_value(index, _NOTHING)
            return
        load = self._load(reference)
        drive = self._drive(reference, load, context.get_discrete_state(self._memory).value())
        motors = reference.position - drive.deflection
        sag, sag_rate = self._known_sag(reference)
        torque = drive.torque - self._gravity_compensation(motors)
        # The drives hold a torque for a period: on the average it is half a period late.
        before = context.get_discrete_state(self._last_torque).value()
        ahead = torque if np.isnan(before[0]) else 1.5 * torque - 0.5 * before
        discrete_state.set_value(0, sag - drive.deflection)
        discrete_state.set_value(1, sag_rate - drive.deflection_rate)
        discrete_state.set_value(2, ahead)
        discrete_state.set_value(int(self._last), reference.position)
        discrete_state.set_value(int(self._last_torque), torque)
        discrete_state.set_value(int(self._memory), drive.memory)

    def _reference(self, context: Context, last: np.ndarray) -> JointReference:
        """The path in joint positions with two derivatives, from its pose, twist and acceleration."""
        q = self._inverse.nearest(self._X_WD.Eval(context).GetAsMatrix34(), last)
        if self._sag is not None:
            q = self._sag.link_positions(q)
        J = self._kinematics.jacobian(q)
        velocity = robust_solve(J, self._V_WD.Eval(context))
        change = (self._kinematics.jacobian(q + _SMALL_TURN * velocity) - J) @ velocity / _SMALL_TURN
        acceleration = robust_solve(J, self._A_WD.Eval(context) - change)
        return JointReference(q, velocity, acceleration)

    def _known_sag(self, reference: JointReference) -> tuple[np.ndarray, np.ndarray]:
        """The deflection under gravity and its rate that are in the law's commands already, (6,) each."""
        if self._sag is None:
            return _NOTHING, _NOTHING
        torque = self._sag.gravity_torque(reference.position)
        moved = self._sag.gravity_torque(reference.position + _SMALL_TURN * reference.velocity)
        return self._compliance * torque, self._compliance * (moved - torque) / _SMALL_TURN

    def _load(self, reference: JointReference) -> np.ndarray:
        """Inverse dynamics of the links: inertia, Coriolis and gravity, without rotors and friction."""
        self._plant.SetPositionsAndVelocities(
            self._context, np.concatenate([reference.position, reference.velocity])
        )
        self._plant.CalcForceElementsContribution(self._context, self._forces)
        total = self._plant.CalcInverseDynamics(self._context, reference.acceleration, self._forces)
        rotors = self._rotor * reference.acceleration + self._viscous * reference.velocity
        return self._inertia * (total - rotors)

    def _gravity_compensation(self, motors: np.ndarray) -> np.ndarray:
        """What the drives add by themselves at these motor positions."""
        self._plant.SetPositions(self._context, motors)
        return -self._plant.CalcGravityGeneralizedForces(self._context)

    def _motor_torque(self, velocity: np.ndarray, acceleration: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Torque of motors that carry a load: rotor inertia, viscous and Coulomb friction (2.63), (2.64)."""
        friction = self._viscous * velocity + self._coulomb * np.tanh(velocity / self._coulomb_velocity)
        return self._rotor * acceleration + friction + load
