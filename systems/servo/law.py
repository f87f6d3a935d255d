"""What all visual-servo laws share: ports, the comparison with the camera, and what is never trusted."""

import importlib
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.dynamics.newton_inverse import InverseSolver, inverse_kinematics
from robots.kinematics.analytic_inverse import JointLimitError, UnreachableError
from robots.kinematics.forward import robust_solve, rotation_about
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.named_classes import OwnClassError
from systems.reference.paths import CartesianPath
from systems.reference.reference import PathAhead
from systems.sampled_system import SampledSystem
from systems.samples import JointSample, PoseSample
from systems.servo.law_config import LawConfig

if TYPE_CHECKING:
    from robots.kinematics.compiled import CompiledKinematics

# rad in one tick: ten times what the fastest joint can do, far less than from branch to branch
LARGEST_STEP = 0.4
_JOINTS_SIZE = 18  # positions, velocities, velocities of the tick before
_NO_COMMAND = np.full(NUM_JOINTS, np.nan)
# The groups of the state, each a port but for what the law itself remembers.
_OUTPUTS = ("position_command", "velocity_command", "correction", "measurement")
_POSITION, _VELOCITY, _CORRECTION, _MEASUREMENT, _MEMORY = range(len(_OUTPUTS) + 1)


class LawInput(NamedTuple):
    """What a law sees at one tick. Poses are the first three rows of homogeneous matrices.

    They are not to be changed: others look at the same arrays.
    """

    X_WD: np.ndarray  # wanted pose, (3, 4)
    V_WD: np.ndarray  # wanted twist, (6,)
    position: np.ndarray  # measured joint positions, (6,) rad
    # Wanted and seen pose at an exposure, (3, 4) each, if it may be used
    measured: tuple[np.ndarray, np.ndarray] | None
    acts_at: float = math.nan  # s, time on the path when the command is believed to act
    exposed_at: float = math.nan  # s, time on the path at that exposure
    is_new: bool = True  # whether no tick before had that exposure


class LawOutput(NamedTuple):
    """What a law answers: a command, its correction so far and its memory for the next tick."""

    position: np.ndarray  # rad
    velocity: np.ndarray  # rad/s
    correction: np.ndarray  # rad and m, rotation first, as a pose error in the world
    memory: np.ndarray


class ServoLaw(SampledSystem):
    """The frame of a visual-servo law on the kinematics that the controller knows.

    A law adds `step` and may add `initial_state`.

    Ports:
        in  ``reference``         PathAhead; it is followed as it is at t + preview
        in  ``joint_sample``      JointSample
        in  ``pose_sample``       PoseSample
        in  ``deviation``         vector 6 in rad, may be left open: what the guard issues less what the law
                                  commands; what the camera sees of it is not the law's to correct
        out ``position_command``  vector 6 in rad, NaN before the first tick and where there is no solution
        out ``velocity_command``  vector 6 in rad/s, likewise
        out ``correction``        vector 6 in rad and m, rotation first: what the law has added to the path
        out ``measurement``       vector 3: when the last usable sample arrived (s), how many were refused,
                                  when the newest one was exposed (s)

    A sample is compared with the path at the instant of its exposure, so that transport delay does not
    look like an error.

    What a law is stands on its class, see `systems.servo.contract.LawTraits`. What it works with:
        ``kinematics``  of the robot as the controller knows it, compliant if that knows its compliances
        ``kernels``     `systems.servo.kernels.steps`, compiled functions
        ``config``      gains and limits, ``gains`` of the six parts of an error (rotation first) in 1/s
        ``period``      of a tick in s
        ``angle_limit`` of the correction in rad
    """

    title = "Law"  # for people
    colour = ""  # in reports, #rrggbb; empty to be given one
    uses_camera = True
    commands_motors = False  # whether positions start from the motors': gears are wound up in them already
    awaits_joints = True  # whether the joints of a tick have a part in it, while the robot runs
    is_compared = False  # whether a comparison has it unless told otherwise
    Config = LawConfig
    memory_size = NUM_JOINTS  # how many numbers a law remembers

    def __init__(self, model: ControllerModel, config: LawConfig, guard: GuardConfig) -> None:
        """Checks the configuration.

        Args:
            model: what the controller believes of the robot, its load and the delays.
            config: gains and limits.
            guard: when to use a sample.

        Raises:
            ValueError: if a gain or a limit is not positive, or the class has no `step`.
        """
        super().__init__()
        if type(self).step is ServoLaw.step and type(self)._tick is ServoLaw._tick:
            raise ValueError(f"servo law: class {type(self).__name__} needs a method 'step'")
        for label in ("translation", "rotation", "correction_limit", "correction_limit_deg"):
            if not getattr(config, label) > 0.0:
                raise ValueError(f"servo law: {label} must be positive, got {getattr(config, label)}")
        robot, period, preview = model.robot, model.period, model.preview
        self.config, self.period = config, period
        # Not before a law is made: it takes time to import.
        self.kernels = importlib.import_module("systems.servo.kernels.steps")
        self.kernels.warm_up()
        self.kinematics = _kinematics(robot, model.payload)
        self._inverse = inverse_kinematics(robot, model.payload)
        self._lower, self._upper = robot.lower.copy(), robot.upper.copy()
        self.gains = np.repeat([config.rotation, config.translation], 3)
        # From the joints of the last tick, as `joints_at` has them, to their positions at this one.
        self._prediction = np.kron([1.0, 1.5 * period, -0.5 * period], np.eye(NUM_JOINTS))
        self.angle_limit = math.radians(config.correction_limit_deg)
        self._guard, self._preview, self._acts_after = guard, preview, model.command_delay
        self._smallest_trace = 1.0 + 2.0 * math.cos(math.radians(guard.largest_deviation_deg))
        self._oldest = model.camera_delay + guard.hold_after + 2.0 * period  # s, of what is compared
        self._reference = self.DeclareAbstractInputPort("reference", Value[object]())
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        self._camera = self.DeclareAbstractInputPort("pose_sample", Value(PoseSample()))
        self._deviation = self.DeclareVectorInputPort("deviation", NUM_JOINTS)
        none = np.array([-np.inf, 0.0, -np.inf])
        for name, value in zip(_OUTPUTS, (_NO_COMMAND, _NO_COMMAND, np.zeros(6), none), strict=True):
            self.DeclareStateOutputPort(name, self.DeclareDiscreteState(value))
        # Not a number until the first tick.
        self._memory = self.DeclareDiscreteState(np.full(self.memory_size, np.nan))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._tick)

    def check_path(self, path: CartesianPath) -> None:
        """Refuses a path that the law cannot follow. Raises ValueError."""

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """The memory with which the law begins, (memory_size,); by default the measured positions in rad."""
        return moment.position

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """One tick of the law; the memory is that of the last one, a copy that may be changed."""
        raise NotImplementedError

    def _tick(self, context: Context, discrete_state: DiscreteValues) -> None:
        time = context.get_time()
        ahead: PathAhead = self._reference.Eval(context)
        joints: JointSample = self._joints.Eval(context)
        sample: PoseSample = self._camera.Eval(context)
        # They hold what the context has, until they are changed.
        measurement = discrete_state.get_mutable_value(_MEASUREMENT)
        last_used, refused, newest = measurement.tolist()
        measured = None
        arrived = sample.valid and sample.time > newest
        # A sample serves until the next one arrives, but not for ever. How late it came does not matter.
        if arrived or (sample.valid and time - last_used <= self._guard.hold_after + 1e-9):
            if time - sample.time <= self._oldest:
                wanted = ahead.moment(sample.time).X_WE
                measured = self.pose_error_at_exposure(wanted, sample, self.guard_offset(context))
            if arrived:
                newest = sample.time
                if measured is None:
                    refused += 1.0
                else:
                    last_used = time

        wanted = ahead.moment(time + self._preview)
        acts_at = ahead.path_time(time + self._acts_after)
        exposed_at = math.nan if measured is None else ahead.path_time(sample.time)
        seen = measured, acts_at, exposed_at, arrived
        moment = LawInput(wanted.X_WE, wanted.V_WE, joints.position, *seen)
        memory = discrete_state.get_mutable_value(_MEMORY).copy()
        if self.memory_size and math.isnan(memory[0]):
            memory = self.initial_state(moment)
            self._require_size("initial_state", "", memory, self.memory_size)
        try:
            step = self.step(moment, memory)
        except (UnreachableError, JointLimitError):
            # No command is an answer too: the guard holds the robot and counts it.
            correction = discrete_state.get_mutable_value(_CORRECTION)
            step = LawOutput(_NO_COMMAND, _NO_COMMAND, correction, memory)
        measurement[:] = last_used, refused, newest
        if not isinstance(step, LawOutput):
            raise OwnClassError(f"class {type(self).__name__}: step must return a LawOutput, got {step!r}")
        try:
            discrete_state.set_value(_POSITION, step.position)
            discrete_state.set_value(_VELOCITY, step.velocity)
            discrete_state.set_value(_CORRECTION, step.correction)
            discrete_state.set_value(_MEMORY, step.memory)
        except (IndexError, TypeError):
            for name in ("position", "velocity", "correction"):
                self._require_size("step", f" as {name}", getattr(step, name), 6)
            self._require_size("step", " as memory", step.memory, self.memory_size)
            raise

    def _require_size(self, method: str, of: str, given: np.ndarray, size: int) -> None:
        """Refuses what a law's own method has given. Raises OwnClassError."""
        if np.shape(given) != (size,):
            shape = "x".join(map(str, np.shape(given))) or "one number"
            wanted = f"{method} must give {size} numbers{of}"
            raise OwnClassError(f"class {type(self).__name__}: {wanted}, got {shape}")

    def joints_at(self, X_WE: np.ndarray, V_WE: np.ndarray, last: np.ndarray) -> np.ndarray:
        """The joints for a pose and a twist, next to those of the last tick.

        The last velocities lead so close that one Newton step is enough; where they do not, or close to a
        singularity, the inverse kinematics is asked.

        Args:
            X_WE, V_WE: where to be, pose (3, 4) and twist (6,).
            last: what this function returned a tick ago, or positions and twelve zeros.

        Returns:
            Positions in rad, velocities in rad/s, and velocities of the tick before, shape (18,).

        Raises:
            UnreachableError, JointLimitError: as `followed_branch`.
        """
        X_WE, V_WE = np.asarray(X_WE, dtype=float), np.asarray(V_WE, dtype=float)
        joints = np.empty(_JOINTS_SIZE)
        joints[:6], joints[12:] = self._prediction.dot(last), last[6:12]
        rows, J = self.kinematics.rows_and_jacobian(joints[:6])
        if not self.kernels.newton_step(X_WE, V_WE, rows, J, self._lower, self._upper, joints[:12]):
            joints[:6] = followed_branch(self._inverse, X_WE, last[:6])
            joints[6:12] = robust_solve(self.kinematics.jacobian(joints[:6]), V_WE)
        return joints

    def within_limits(self, twist: np.ndarray, correction: np.ndarray) -> np.ndarray:
        """The twist that a law adds; where the correction stands at its limit, it may only shrink.

        Args:
            twist: (6,), which is changed.
            correction: (6,) in rad and m, rotation first.
        """
        self.kernels.limit_twist(twist, correction, self.angle_limit, self.config.correction_limit)
        return twist

    def guard_offset(self, context: Context) -> tuple[np.ndarray, np.ndarray] | None:
        """Where the tool is led and where the law would have it, poses (3, 4); None if that is the same."""
        if not self._deviation.HasValue(context):
            return None
        deviation = self._deviation.Eval(context)
        if not any(deviation.tolist()):
            return None
        commanded = context.get_discrete_state().value(_POSITION)
        if math.isnan(commanded[0]):
            return None
        # A law that commands speeds does so from where the joints are, any other from where they shall be.
        led = commanded if self.config.drive == "velocity" else commanded + deviation
        forward = self.kinematics.forward
        return forward(led)[:3], forward(led - deviation)[:3]

    def pose_error_at_exposure(
        self, wanted: np.ndarray, sample: PoseSample, offset: tuple[np.ndarray, np.ndarray] | None
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """The pose that was wanted when a sample was exposed, and the pose that was seen, (3, 4) each.

        Args:
            wanted: where the path was at the exposure, (3, 4).
            sample: a valid sample.
            offset: what `guard_offset` says of the robot; it is taken to be so at the exposure already.

        Returns:
            None if the sample is too far from the path to be true.
        """
        if offset is not None:
            wanted = _shifted_by_guard(wanted, *offset)
        seen = np.ascontiguousarray(sample.X_WE.GetAsMatrix34())
        gap_squared, trace = self.kernels.distance(wanted, seen)
        if gap_squared > self._guard.largest_deviation**2 or trace < self._smallest_trace:
            return None
        return wanted, seen


def _kinematics(robot: RobotModel, payload: float) -> "CompiledKinematics | CompliantKinematics":
    """Of the robot as it is known; compiled here, for that needs numba."""
    if robot.has_joint_calibration:
        return CompliantKinematics(robot, payload)
    compiled = importlib.import_module("robots.kinematics.compiled")
    return compiled.CompiledKinematics(robot)


def _shifted_by_guard(X: np.ndarray, led: np.ndarray, wished: np.ndarray) -> np.ndarray:
    """A pose (3, 4), displaced as the tool is that is led to one pose and not to the wished one."""
    displaced = np.empty((3, 4))
    displaced[:, :3] = led[:, :3] @ wished[:, :3].T @ X[:, :3]
    displaced[:, 3] = X[:, 3] + led[:, 3] - wished[:, 3]
    return displaced


def integrate_twist(X: np.ndarray, step: np.ndarray) -> np.ndarray:
    """A pose (3, 4), moved by a small spatial displacement (rad, m) in world axes."""
    angle = math.sqrt(float(step[:3] @ step[:3]))
    moved = np.empty((3, 4))
    moved[:, :3] = rotation_about(step[:3] / (angle or 1.0), angle) @ X[:, :3]
    moved[:, 3] = X[:, 3] + step[3:]
    return moved


def followed_branch(inverse: InverseSolver, X_WE: np.ndarray, q_near: np.ndarray) -> np.ndarray:
    """The joint positions of a pose (3, 4) next to the last ones.

    Raises:
        UnreachableError: if the pose is out of reach, or only on a branch that is a jump away.
        JointLimitError: if a joint limit is in the way.
    """
    q = inverse.nearest(X_WE, q_near)
    check_branch_continuity(q - q_near)
    return q


def check_branch_continuity(step: np.ndarray) -> None:
    """Lets only steps of the joint positions (rad, shape (6,)) pass that a path can take in one tick.

    Raises:
        UnreachableError: if the step is larger.
    """
    check_step(step.dot(step))


def check_step(squared: float) -> None:
    """The same for the square of a step in rad^2. Raises UnreachableError."""
    if squared > LARGEST_STEP**2:
        raise UnreachableError("the path is out of reach, or goes on only on another branch")
