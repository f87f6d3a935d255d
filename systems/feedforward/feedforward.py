"""What all feedforwards share: ports, the joint reference with its derivatives, and the load of the links."""

import math
from collections.abc import Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context, DiscreteValues

from robots.description.model import NUM_JOINTS
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.dynamics.plant import add_robot
from robots.kinematics.analytic_inverse import JointLimitError, UnreachableError
from robots.kinematics.forward import Kinematics, robust_solve
from systems.controller_model import ControllerModel
from systems.feedforward.between_ticks import BetweenTicks
from systems.feedforward.config import FeedforwardConfig
from systems.feedforward.joint_motion import Answer, Drive, JointReference, Standing
from systems.feedforward.prefilter import Prefilter
from systems.named_classes import OwnClassError
from systems.reference.paths import CartesianPath
from systems.sampled_system import SampledSystem
from systems.samples import JointSample

_LONGEST_SUBSTEP = 2e-3  # s; half of it changes the torque of an elastic inverse by some tenths of a percent
_OF_REFERENCE = 3 * NUM_JOINTS  # numbers
_SMALL_TURN = 1e-5  # s times the joint velocity: over which the change of the Jacobian is measured
_NOTHING = np.zeros(NUM_JOINTS)
_NO_COMMAND = np.full(NUM_JOINTS, np.nan)
_OUTPUTS = {  # before the first tick, and out of reach
    "position_command": _NO_COMMAND,
    "velocity_command": _NO_COMMAND,
    "torque_feedforward": _NOTHING,
    "position_offset": _NOTHING,
    "velocity_offset": _NOTHING,
}


class Feedforward(SampledSystem):
    """The frame of an inverse model; a model adds `drive_under`.

    Ports:
        in  ``X_WE_desired``        RigidTransform, the wanted pose at t + preview
        in  ``V_WE_desired``        vector 6, its spatial velocity
        in  ``A_WE_desired``        vector 6, its spatial acceleration
        in  ``joint_sample``        JointSample, whose positions choose the branch at the beginning
        out ``position_command``    vector 6 in rad, of the motors
        out ``velocity_command``    vector 6 in rad/s, likewise
        out ``torque_feedforward``  vector 6 in N m, joint side, beyond the drives' gravity compensation
        out ``position_offset``     vector 6 in rad, what a law's commands for the links lack to be motors'
        out ``velocity_offset``     vector 6 in rad/s, likewise

    The commands drive a robot by themselves. Beside a law the offsets are added to its commands: the law
    leads the links along the path and corrects what the model leaves. Where a calibrated robot knows its
    compliances, the law's commands contain the deflection under gravity already, and the offsets only the
    rest. Out of reach the commands are NaN, which is none, and the other outputs zero.

    With a prefilter the derivatives of the path come from it, and the links follow the path as late as the
    filter is; the offsets contain the difference, so that this too goes with any law. ``delay`` says how much
    more preview makes up for it. Without one the path itself has to be smooth enough, see `check_path`.

    Drives hold a torque until the next tick, so a model runs half a tick ahead, to the middle of the hold, in
    sub-steps of at most 2 ms: what it differentiates does not depend on how long a tick is.

    Attributes:
        delay: s, of the prefilter.
        substep: s, from one call of `drive` to the next.
    """

    title = "feedforward"  # for people
    colour = ""  # in figures, #rrggbb
    memory_size = 0  # how many numbers a model remembers
    derivatives = 2  # the highest derivative of the joint positions on which the outputs depend
    is_computed_beforehand = False  # for the whole path at its planned speed, which then must not be slowed

    def __init__(
        self,
        model: ControllerModel,
        config: FeedforwardConfig,
        extra_memory: int = 0,
    ) -> None:
        """Builds the rigid model.

        Args:
            model: what the controller believes of the robot and its load.
            config: how wrong the model is beyond that, and how its reference becomes differentiable.
            extra_memory: numbers that the model remembers beside its class's ``memory_size``.

        Raises:
            ValueError: if an error makes a stiffness or a mass vanish, the prefilter's order is too low, or
                the class has no `drive_under`.
        """
        super().__init__()
        own, base = type(self), Feedforward
        if (own.drive_under, own.drive, own._tick) == (base.drive_under, base.drive, base._tick):
            raise ValueError(f"feedforward: class {own.__name__} needs a method 'drive_under'")
        robot, period, payload = model.robot, model.period, model.payload
        self._between = BetweenTicks(period, _LONGEST_SUBSTEP)
        self.substep = self._between.substep
        for label in ("stiffness_error", "inertia_error"):
            if not -1.0 < getattr(config, label) < np.inf:
                raise ValueError(
                    f"feedforward: {label} must be above -1 and finite, got {getattr(config, label)}"
                )
        self._inertia = 1.0 + config.inertia_error
        self._stiffness = (1.0 + config.stiffness_error) * robot.joint_stiffness
        self._damping = (1.0 + config.stiffness_error) * robot.joint_damping
        self._rotor, self._viscous = robot.reflected_inertia, robot.joint_viscous_friction
        self._coulomb, self._coulomb_velocity = robot.joint_coulomb_friction, robot.coulomb_velocity
        # Beyond these, what a robot file says of its drive trains; friction is in them then.
        self._trains = robot.drive_trains
        self._kinematics = Kinematics(robot)
        self._filter, self._config = None, config
        if config.prefilter.kind != "none":
            user = f"feedforward {config.kind}"
            self._filter = Prefilter(config.prefilter, self.substep, self.derivatives, user)
        self.delay = self._filter.delay if self._filter else 0.0  # s
        of_filter = (self._filter.order + 1) * NUM_JOINTS if self._filter else 0
        # The reference of the last tick; the filter's input and states; what the model remembers.
        self._parts_of_memory = np.cumsum([_OF_REFERENCE, of_filter])
        self._memory_size = _OF_REFERENCE + of_filter + self.memory_size + extra_memory
        # Where the links have to be: the law alone cares for their sag under gravity, if it knows of it.
        self._inverse = inverse_kinematics(robot, payload)
        self._sag = CompliantKinematics(robot, payload) if robot.compliance.any() else None
        self._compliance = robot.compliance
        self._plant = MultibodyPlant(0.0)
        self._parts = add_robot(self._plant, robot, "rigid", payload)
        self._plant.Finalize()
        # Scratch memory only: written before every use.
        self._context, self._forces = self._plant.CreateDefaultContext(), MultibodyForces(self._plant)
        self._X_WD = self.DeclareAbstractInputPort("X_WE_desired", Value(RigidTransform()))
        self._V_WD = self.DeclareVectorInputPort("V_WE_desired", 6)
        self._A_WD = self.DeclareVectorInputPort("A_WE_desired", 6)
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        for name, value in _OUTPUTS.items():
            self.DeclareStateOutputPort(name, self.DeclareDiscreteState(value))
        self._last = self.DeclareDiscreteState(np.full(NUM_JOINTS, np.nan))
        self._memory = self.DeclareDiscreteState(self.fresh_memory())
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._tick)

    def fresh_memory(self) -> np.ndarray:
        """The memory before the first tick: not a number throughout, shape (m,)."""
        return np.full(self._memory_size, np.nan)

    def answer(self, reference: JointReference, memory: np.ndarray) -> Answer:
        """One tick of the inverse model.

        Args:
            reference: of the links.
            memory: of the last tick, `fresh_memory` at the first one.
        """
        last, filtered, memory = np.split(memory, self._parts_of_memory)
        now = np.stack([reference.position, reference.velocity, reference.acceleration])
        drives = []
        for moment in self._between.references(last.reshape(3, NUM_JOINTS), now):
            smooth = JointReference(*moment)
            if self._filter is not None:
                smooth, filtered = self._filtered(self._filter, moment[0], filtered)
            drive = self.drive(smooth, memory)
            self._require_sizes(drive, len(memory))
            memory = drive.memory
            drives.append((smooth, drive))
        (smooth, drive), (later, ahead) = drives[self._between.half - 1], drives[-1]
        position, velocity = smooth.position - drive.deflection, smooth.velocity - drive.deflection_rate
        sag, sag_rate = self._known_sag(reference)
        return Answer(
            position,
            velocity,
            sag + position - reference.position,
            sag_rate + velocity - reference.velocity,
            ahead.torque - self._gravity_compensation(later.position - ahead.deflection),
            np.concatenate([now.ravel(), filtered, memory]),
        )

    def _require_sizes(self, drive: Drive, memory_size: int) -> None:
        """Refuses what a model's own method has given. Raises OwnClassError."""
        if not isinstance(drive, Drive):
            raise OwnClassError(
                f"class {type(self).__name__}: drive_under must return a Drive, got {drive!r}"
            )
        sizes = {"deflection": NUM_JOINTS, "deflection_rate": NUM_JOINTS, "torque": NUM_JOINTS}
        for name, size in (sizes | {"memory": memory_size}).items():
            given = np.shape(getattr(drive, name))
            if given != (size,):
                shape = "x".join(map(str, given)) or "one number"
                wanted = f"drive_under must give {size} numbers as {name}"
                raise OwnClassError(f"class {type(self).__name__}: {wanted}, got {shape}")
        for name in sizes:
            given = np.asarray(getattr(drive, name))
            if given.dtype.kind not in "fiu" or not math.isfinite(sum(given.tolist())):
                wanted = f"drive_under must give finite numbers as {name}"
                raise OwnClassError(f"class {type(self).__name__}: {wanted}, got {given.tolist()}")

    def play(self, references: Sequence[JointReference]) -> np.ndarray:
        """Commands at successive ticks: positions in rad, velocities in rad/s, torques in N m; (n, 3, 6)."""
        memory, rows = self.fresh_memory(), []
        for reference in references:
            answer = self.answer(reference, memory)
            memory = answer.memory
            rows.append((answer.position, answer.velocity, answer.torque))
        return np.array(rows)

    def prepare(self, path: CartesianPath, home: np.ndarray, standing: Standing | None = None) -> None:
        """What is to be done before a run; a model that looks ahead takes its time here.

        Args:
            path: that the run will ask for.
            home: where the joints are before it, in rad, shape (6,).
            standing: the robot there, if a camera has looked at it.

        Raises:
            ValueError: if the path is not for this model.
        """
        self.check_path(path)

    def check_path(self, path: CartesianPath) -> None:
        """Refuses a path that is too rough.

        Raises:
            ValueError: if the outputs depend on more derivatives of the path than are continuous, there is no
                prefilter, and the configuration does not accept what comes of it.
        """
        if self._filter is not None or self._config.rough_path == "accept":
            return
        if path.continuous_derivatives < self.derivatives:
            raise ValueError(
                f"feedforward {self._config.kind} takes {self.derivatives} derivatives of its path, of which "
                f"{path.continuous_derivatives} are continuous: choose reference.timing=polynomial, "
                "servo.feedforward.prefilter.kind=bessel, or servo.feedforward.rough_path=accept"
            )

    def drive(self, reference: JointReference, memory: np.ndarray) -> Drive:
        """What the motors shall do, a sub-step after the last call; the memory is that of `drive_under`."""
        return self.drive_under(reference, self.link_load(reference), memory)

    def drive_under(self, reference: JointReference, load: np.ndarray, memory: np.ndarray) -> Drive:
        """What the motors shall do.

        Args:
            reference: of the links.
            load: torques in N m that move the links so, without rotors and friction, shape (6,).
            memory: the model's own, of the last sub-step, NaN at the first one.
        """
        raise NotImplementedError

    def _tick(self, context: Context, discrete_state: DiscreteValues) -> None:
        last = context.get_discrete_state(self._last).value()
        if np.isnan(last[0]):
            last = self._joints.Eval(context).position
        try:
            q = self._link_positions(self._X_WD.Eval(context), last)
        except (UnreachableError, JointLimitError):
            for index, value in enumerate(_OUTPUTS.values()):
                discrete_state.set_value(index, value)
            discrete_state.set_value(int(self._memory), self.fresh_memory())
            return
        reference = self._joint_reference(context, q)
        answer = self.answer(reference, context.get_discrete_state(self._memory).value())
        outputs = (
            answer.position,
            answer.velocity,
            answer.torque,
            answer.position_offset,
            answer.velocity_offset,
        )
        for index, value in enumerate(outputs):
            discrete_state.set_value(index, value)
        discrete_state.set_value(int(self._last), q)
        discrete_state.set_value(int(self._memory), answer.memory)

    def _link_positions(self, X_WD: RigidTransform, last: np.ndarray) -> np.ndarray:
        q = self._inverse.nearest(X_WD.GetAsMatrix34(), last)
        return q if self._sag is None else self._sag.link_positions(q)

    def _joint_reference(self, context: Context, q: np.ndarray) -> JointReference:
        return self.moving_reference(q, self._V_WD.Eval(context), self._A_WD.Eval(context))

    def moving_reference(self, q: np.ndarray, V_WE: np.ndarray, A_WE: np.ndarray) -> JointReference:
        """Two derivatives of the path in joint positions (rad) from its twist and acceleration, (6,)."""
        J = self._kinematics.jacobian(q)
        velocity = robust_solve(J, V_WE)
        change = (self._kinematics.jacobian(q + _SMALL_TURN * velocity) - J) @ velocity / _SMALL_TURN
        return JointReference(q, velocity, robust_solve(J, A_WE - change))

    @staticmethod
    def _filtered(
        prefilter: Prefilter, position: np.ndarray, memory: np.ndarray
    ) -> tuple[JointReference, np.ndarray]:
        """The smooth reference a sub-step later; the memory holds the last input and the states."""
        before, state = memory[:NUM_JOINTS], memory[NUM_JOINTS:].reshape(-1, NUM_JOINTS)
        is_first = np.isnan(before[0])
        state = prefilter.at_rest(position) if is_first else prefilter.step(state, before, position)
        acceleration = state[2] if len(state) > 2 else prefilter.highest_derivative(state, position)
        return JointReference(state[0], state[1], acceleration), np.concatenate([position, state.ravel()])

    def _known_sag(self, reference: JointReference) -> tuple[np.ndarray, np.ndarray]:
        """The deflection under gravity and its rate that are in the law's commands already, (6,) each."""
        if self._sag is None:
            return _NOTHING, _NOTHING
        torque = self._sag.gravity_torque(reference.position)
        moved = self._sag.gravity_torque(reference.position + _SMALL_TURN * reference.velocity)
        return self._compliance * torque, self._compliance * (moved - torque) / _SMALL_TURN

    def link_load(self, reference: JointReference) -> np.ndarray:
        """Torques of the links in N m, (6,): inertia, Coriolis and gravity, without rotors and friction."""
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
        return -self._parts.load(self._context)

    def motor_torque(self, velocity: np.ndarray, acceleration: np.ndarray, load: np.ndarray) -> np.ndarray:
        """In N m, joint side, (6,): load, rotor inertia, viscous and Coulomb friction, (2.63), (2.64)."""
        if self._trains is not None:
            return self._rotor * acceleration + load + self._trains.losses(load, velocity)
        friction = self._viscous * velocity + self._coulomb * np.tanh(velocity / self._coulomb_velocity)
        return self._rotor * acceleration + friction + load
