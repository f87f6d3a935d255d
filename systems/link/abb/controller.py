"""A virtual EGM controller without sockets: reports, references, time-outs and the RAPID program."""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from robots.configuration.quantity import quantity
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.analytic_inverse import JointLimitError, UnreachableError
from robots.kinematics.forward import Kinematics, robust_solve
from systems.link.abb.messages import Command, EgmError, Pose, decode_command, fill_pose
from systems.link.abb.path_program import PathProgram
from systems.link.abb.schema import (
    DATA,
    MCI_RUNNING,
    MCI_STOPPED,
    MOTORS_OFF,
    MOTORS_ON,
    RAPID_RUNNING,
    EgmRobot,
)
from systems.link.abb.signals import ControllerSignals, SignalCodec, SignalLayout

_WRAP = 2**32
_BEYOND = math.radians(5.0)  # beyond the range of a joint, from which a reference is ignored
_STANDING = np.full(NUM_JOINTS, math.nan)


@dataclass
class EgmRunConfig:
    """Arguments of the RAPID program's EGM calls; read from a scenario file."""

    timeout: float = quantity(0.2, 0.01, 60.0, "s")  # without a command, after which EGM ends
    # Converged when every joint is so close to its reference
    condition_deg: float = quantity(0.01, 1e-6, 360.0, "deg")
    condition_time: float = quantity(60.0, 1e-3, 3600.0, "s")  # of convergence after which EGM ends
    restart_after: float = 0.5  # s after its end until EGM is run again; negative: never
    # Whether the program runs the path itself (EGMMoveL) and takes path corrections alone
    path_correction: bool = False
    correction_lag: float = quantity(0.05, 0.0, 10.0, "s")  # with which these are taken up (assumed)
    # Of the largest joint speeds, beyond which the reported utilisation rate is above 100 % (assumed)
    performance: float = quantity(1.0, 0.01, 10.0)
    # Whether the program runs the path itself, again and again, and only says where it is (EGMStreamStart)
    streams: bool = False


class RunState(Enum):
    """States of the RAPID program."""

    RUNNING = "running"  # EGM takes commands
    PAUSED = "paused"  # EGM has ended and will be run again
    ENDED = "ended"  # the program has stopped


class VirtualController:
    """Emulates an ABB controller. Times are on the controller's clock, in s."""

    def __init__(
        self,
        robot: RobotModel,
        config: EgmRunConfig,
        signals: SignalLayout | None = None,
        program: PathProgram | None = None,
    ) -> None:
        """Starts the program at its first cycle.

        Args:
            robot: as the controller knows it.
            config: of the program.
            signals: which test signals it sends.
            program: a path that it runs itself; None to be guided by commands.

        Raises:
            ValueError: if a time or an angle is not positive, or there cannot be such a layout of signals.
        """
        for name in ("timeout", "condition_deg", "condition_time"):
            if not getattr(config, name) > 0.0:
                raise ValueError(f"EGM: {name} must be positive, got {getattr(config, name)}")
        self.state = RunState.RUNNING
        self.motors_on, self.has_collided = True, False
        self.restarts = self.undecodable = self.late = self.ignored = 0
        self._config = config
        self._codec = SignalCodec(signals or SignalLayout())
        self._lower, self._upper = robot.lower - _BEYOND, robot.upper + _BEYOND
        self._kinematics, self._inverse = Kinematics(robot), inverse_kinematics(robot)
        self._fastest = config.performance * robot.speed
        self._planned: tuple[float, np.ndarray] | None = None  # of the last report, time in s and rad
        self._seqno = 0
        self._began: float | None = None
        self._ended = self._heard = self._unconverged = -math.inf
        self._last_command: int | None = None
        self._reference, self._speed = _STANDING, _STANDING
        self._commanded = False  # whether this run has got a command
        self._program, self._program_began = program, math.nan

    @property
    def is_running(self) -> bool:
        """Whether commands are followed."""
        return self.state is RunState.RUNNING and self.motors_on and not self._config.streams

    @property
    def references(self) -> tuple[np.ndarray, np.ndarray]:
        """Reference (6,) in rad and speed (6,) in rad/s; NaN for what is not given, both to stand still."""
        return self._reference, self._speed

    def stop(self, time: float, for_good: bool = False) -> None:
        """Ends EGM, for example because somebody stops the program."""
        if self.state is RunState.RUNNING:
            self._ended = time
        self.state = RunState.ENDED if for_good else RunState.PAUSED
        self._reference = self._speed = _STANDING

    def collide(self, time: float) -> None:
        """The robot hits something: its own supervision stops it and says so."""
        self.has_collided = True
        self.stop(time)

    def receive(self, data: bytes, time: float, position: np.ndarray) -> bool:
        """Takes a datagram of a client; what it cannot follow is counted and ignored.

        Args:
            data: the datagram.
            time: now.
            position: planned joint positions (6,) in rad, near which a pose is solved.

        Returns:
            Whether it is followed.
        """
        try:
            seqno, command = decode_command(data)
        except EgmError:
            self.undecodable += 1
            return False
        if not self.is_running:
            self.ignored += 1
            return False
        if self._last_command is not None:
            ahead = (seqno - self._last_command + _WRAP // 2) % _WRAP - _WRAP // 2
            # A client that starts anew counts from the beginning.
            if -100 < ahead <= 0:
                self.late += 1
                return False
        if (command.path_correction is not None) != (self._program is not None):
            self.ignored += 1
            return False
        if self._program is not None and command.path_correction is not None:
            self._program.correct(command.path_correction)
            self._last_command, self._heard, self._commanded = seqno, time, True
            return True
        try:
            reference, speed = self._in_joints(command, position)
        except (UnreachableError, JointLimitError):
            self.ignored += 1
            return False
        if (reference < self._lower).any() or (reference > self._upper).any():
            self.ignored += 1
            return False
        self._last_command, self._heard, self._commanded = seqno, time, True
        self._reference, self._speed = reference, speed
        return True

    def cycle(self, time: float, planned: np.ndarray) -> None:
        """Moves the program on by one cycle.

        Args:
            time: now.
            planned: planned joint positions (6,) in rad.
        """
        if self.state is RunState.PAUSED and 0.0 <= self._config.restart_after <= time - self._ended:
            self.state, self._began = RunState.RUNNING, None
            self.restarts += 1
            self._seqno, self._last_command, self._commanded = 0, None, False
            self._program_began = math.nan
        if self.state is not RunState.RUNNING:
            return
        if self._began is None:
            self._began = self._heard = self._unconverged = time
        # The time-out begins with the first command; until then the program waits for the client.
        if self._commanded and time - self._heard > self._config.timeout:
            self.stop(time, for_good=self._program is not None)
            return
        if self._program is not None:
            self._run_program(self._program, time, planned)
            return
        if not self._commanded or not self._is_converged(planned):
            self._unconverged = time
        elif time - self._unconverged >= self._config.condition_time:
            self.stop(time)

    def _run_program(self, program: PathProgram, time: float, planned: np.ndarray) -> None:
        """The path begins with the first correction and ends for good; one that streams waits for nobody."""
        streams = self._config.streams
        if not (self._commanded or streams):
            return
        if math.isnan(self._program_began):
            self._program_began = time
            program.begin()
        self._reference, self._speed, is_over = program.at(time - self._program_began, planned)
        if is_over and streams:
            self._program_began = math.nan
        elif is_over:
            self.stop(time, for_good=True)

    def report(
        self,
        time: float,
        position: np.ndarray,
        planned: np.ndarray,
        torque: np.ndarray,
    ) -> bytes:
        """The message of this cycle.

        Args:
            time: when the joints were read.
            position: measured joint positions (6,) in rad.
            planned: planned joint positions (6,) in rad.
            torque: of the motors, joint side, (6,) in N m.
        """
        message = EgmRobot()
        self._seqno = (self._seqno + 1) % _WRAP
        message.header.seqno, message.header.mtype = self._seqno, DATA
        message.header.tm = int(1e3 * time) % _WRAP
        for part, joints in ((message.feedBack, position), (message.planned, planned)):
            part.joints.joints.extend(np.rad2deg(joints).tolist())
            fill_pose(part.cartesian, self._pose(joints))
            part.time.sec, part.time.usec = int(time), round(1e6 * (time - int(time)))
        message.motorState.state = MOTORS_ON if self.motors_on else MOTORS_OFF
        message.mciState.state = MCI_RUNNING if self.is_running else MCI_STOPPED
        message.mciConvergenceMet = self._commanded and self._is_converged(planned)
        message.rapidExecState.state = RAPID_RUNNING
        message.torqueRef.joints.extend(torque.tolist())
        if self._planned is not None and time > self._planned[0]:
            speed = np.abs(planned - self._planned[1]) / (time - self._planned[0])
            message.utilizationRate = 100.0 * float((speed / self._fastest).max())
        self._planned = time, planned.copy()
        if self.has_collided:
            message.CollisionInfo.collsionTriggered = True
        return message.SerializeToString()

    def signals(self, time: float, position: np.ndarray, velocity: np.ndarray, torque: np.ndarray) -> bytes:
        """The test signals of this cycle; arguments as of `report`, velocity in rad/s. Nothing pushes it."""
        nothing = np.zeros(NUM_JOINTS), np.zeros(2)
        return self._codec.encode(ControllerSignals(time, velocity, torque, position, *nothing))

    def counters(self) -> dict[str, int]:
        """How often the program began anew, and what became of the datagrams, by name."""
        return {name: getattr(self, name) for name in ("restarts", "undecodable", "late", "ignored")}

    def _pose(self, joints: np.ndarray) -> Pose:
        X = self._kinematics.forward(joints)
        return Pose(X[:3, 3], RotationMatrix(X[:3, :3]).ToQuaternion().wxyz())

    def _is_converged(self, planned: np.ndarray) -> bool:
        reference = self._reference
        if math.isnan(reference[0]):
            return False
        return bool(np.abs(reference - planned).max() <= math.radians(self._config.condition_deg))

    def _in_joints(self, command: Command, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Reference and speed of the joints that a command asks for."""
        reference, speed = command.position, command.velocity
        X_WE: np.ndarray | None = None
        if command.pose is not None and reference is None:
            X_WE = _matrix(command.pose)
            reference = self._inverse.nearest(X_WE[:3], position)
        if command.pose_velocity is not None and speed is None:
            at = position if reference is None else reference
            speed = self._joint_speed(command.pose_velocity, at)
        if reference is None and speed is None:
            return _STANDING, _STANDING
        return (
            _STANDING if reference is None else reference,
            np.zeros(NUM_JOINTS) if speed is None else speed,
        )

    def _joint_speed(self, pose_velocity: np.ndarray, position: np.ndarray) -> np.ndarray:
        """Joint speeds for a speed of the tool; rates of Euler angles about x, y, z, or of the quaternion."""
        R = RotationMatrix(self._kinematics.forward(position)[:3, :3])
        if len(pose_velocity) == 6:
            angles = RollPitchYaw(R)
            omega = angles.CalcAngularVelocityInParentFromRpyDt(pose_velocity[3:])
        else:
            w, *v = R.ToQuaternion().wxyz()
            dw, *dv = pose_velocity[3:]
            v, dv = np.array(v), np.array(dv)
            omega = 2.0 * (w * dv - dw * v + np.cross(v, dv))
        twist = np.concatenate([omega, pose_velocity[:3]])
        return robust_solve(self._kinematics.jacobian(position), twist)


def _matrix(pose: Pose) -> np.ndarray:
    """A pose as a homogeneous matrix."""
    if pose.euler_zyx is not None:
        rotation = RollPitchYaw(pose.euler_zyx[::-1]).ToRotationMatrix()
    else:
        assert pose.quaternion is not None
        rotation = RotationMatrix(Quaternion(wxyz=pose.quaternion))
    return RigidTransform(rotation, pose.position).GetAsMatrix4()
