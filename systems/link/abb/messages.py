"""EGM messages: reports of the controller and commands to it, in SI units and as bytes."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.link.abb.schema import (
    COMMAND,
    CORRECTION,
    MCI_RUNNING,
    MOTORS_ON,
    PATH_CORRECTION,
    RAPID_RUNNING,
    DecodeError,
    EgmRobot,
    EgmSensor,
    EgmSensorPathCorr,
    measured_force,
)
from systems.link.session import TelegramError

_LARGEST_ANGLE = 3600.0  # deg; no joint is ten turns from its zero
_LARGEST = 1e6  # deg, mm and per s: no robot is so large or so fast, and squares of it are numbers
_LARGEST_COUNT = 2**32


class EgmError(TelegramError):
    """A datagram that is not an EGM message, or has impossible content."""


class Mode(Enum):
    """The kind of command that is sent, Probst (2024), table A.6; with Euler angles or a quaternion."""

    JOINT = "joint"
    JOINT_SPEED = "joint_speed"
    JOINT_SPEED_ONLY = "joint_speed_only"
    POSE_EULER = "pose_euler"
    POSE_EULER_SPEED = "pose_euler_speed"
    POSE_EULER_SPEED_ONLY = "pose_euler_speed_only"
    POSE_QUAT = "pose_quat"
    POSE_QUAT_SPEED = "pose_quat_speed"
    POSE_QUAT_SPEED_ONLY = "pose_quat_speed_only"
    SPEED = "speed"
    ALL = "all"
    PATH_CORRECTION = "path_correction"

    @property
    def has_joints(self) -> bool:
        """Whether joint positions are sent."""
        return self in (Mode.JOINT, Mode.JOINT_SPEED, Mode.ALL)

    @property
    def has_joint_speeds(self) -> bool:
        """Whether joint speeds are sent."""
        return self in (Mode.JOINT_SPEED, Mode.JOINT_SPEED_ONLY, Mode.SPEED, Mode.ALL)

    @property
    def has_pose(self) -> bool:
        """Whether a pose is sent."""
        return self in (
            Mode.POSE_EULER,
            Mode.POSE_EULER_SPEED,
            Mode.POSE_QUAT,
            Mode.POSE_QUAT_SPEED,
            Mode.ALL,
        )

    @property
    def has_pose_speed(self) -> bool:
        """Whether the speed of the pose is sent."""
        return self in (
            Mode.POSE_EULER_SPEED,
            Mode.POSE_EULER_SPEED_ONLY,
            Mode.POSE_QUAT_SPEED,
            Mode.POSE_QUAT_SPEED_ONLY,
            Mode.SPEED,
            Mode.ALL,
        )

    @property
    def is_euler(self) -> bool:
        """Whether the orientation is sent as Euler angles; a controller prefers them to a quaternion."""
        return self in (
            Mode.POSE_EULER,
            Mode.POSE_EULER_SPEED,
            Mode.POSE_EULER_SPEED_ONLY,
            Mode.SPEED,
        )


@dataclass(frozen=True)
class Pose:
    """A pose as it is on the wire, but in SI units."""

    position: np.ndarray  # (3,) m
    quaternion: np.ndarray | None = None  # (4,) w first
    euler_zyx: np.ndarray | None = None  # (3,) rad about z, y, x


@dataclass(frozen=True)
class Command:
    """A command to a controller; the mode selects which fields are sent."""

    position: np.ndarray | None = None  # (6,) rad
    velocity: np.ndarray | None = None  # (6,) rad/s
    pose: Pose | None = None
    pose_velocity: np.ndarray | None = (
        None  # (6,) m/s, then rates of the Euler angles in rad/s about x, y, z;
    )
    # (7,) with the rates of the quaternion instead
    path_correction: np.ndarray | None = None  # (3,) m, in the frame of the path


@dataclass(frozen=True, slots=True)
class RobotReport:
    """A message of a controller; rarely used fields are properties and decoded on demand."""

    seqno: int
    time: float  # s, the controller's clock: when the joints were read
    position: np.ndarray  # (6,) rad
    motors_on: bool
    egm_running: bool  # EGM takes commands
    rapid_running: bool
    message: Any  # EgmRobot

    @property
    def is_ready(self) -> bool:
        """Whether the robot follows commands."""
        return self.motors_on and self.egm_running

    @property
    def converged(self) -> bool:
        """Whether the robot has come to what it was told."""
        return bool(self.message.mciConvergenceMet)

    @property
    def has_collided(self) -> bool:
        """Whether the controller has noticed a collision."""
        return self.message.HasField("CollisionInfo") and bool(self.message.CollisionInfo.collsionTriggered)

    @property
    def utilization(self) -> float:
        """How much of its performance the robot needs, 1 for all of it; 0 if it is not sent."""
        return 0.01 * self.message.utilizationRate

    @property
    def pose(self) -> Pose | None:
        """The pose of the tool in the controller's work object, None if it is not sent."""
        feedback = self.message.feedBack
        return _pose(feedback.cartesian) if feedback.HasField("cartesian") else None

    @property
    def planned_position(self) -> np.ndarray:
        """Planned joint positions in rad, empty if they are not sent."""
        return np.deg2rad(self.message.planned.joints.joints)

    @property
    def external_position(self) -> np.ndarray:
        """Positions of external joints as they are sent, in degrees or mm."""
        return np.array(self.message.feedBack.externalJoints.joints)

    @property
    def test_signals(self) -> np.ndarray:
        """Test signals as they are sent, in the order and the units of the sender, shape (n,)."""
        return np.array(self.message.testSignals.signals)

    @property
    def force(self) -> list[float]:
        """The measured force in N and N m, empty if there is none. Raises EgmError if it cannot be read."""
        try:
            return measured_force(self.message.measuredForce)
        except DecodeError as error:
            raise EgmError(f"measured force: {error}") from error


def decode_report(data: bytes) -> RobotReport:
    """Reads a message of a controller.

    Raises:
        EgmError: if it is not one, or its joints are not six finite angles.
    """
    try:
        message = EgmRobot.FromString(data)
    except DecodeError as error:
        raise EgmError(f"not an EGM message: {error}") from error
    if not message.HasField("header") or not message.HasField("feedBack"):
        raise EgmError("an EGM message without header or feedback")
    feedback = message.feedBack
    degrees = list(feedback.joints.joints)
    if len(degrees) != NUM_JOINTS:
        raise EgmError(f"an EGM message with {len(degrees)} joints, the robot has {NUM_JOINTS}")
    # A NaN is in no range.
    if not all(-_LARGEST_ANGLE <= angle <= _LARGEST_ANGLE for angle in degrees):
        raise EgmError(f"an EGM message with joint angles of {degrees} degrees")
    header, clock = message.header, feedback.time
    return RobotReport(
        header.seqno,
        clock.sec + 1e-6 * clock.usec if clock.sec or clock.usec else 1e-3 * header.tm,
        np.array(degrees) * (math.pi / 180.0),
        message.motorState.state == MOTORS_ON,
        message.mciState.state == MCI_RUNNING,
        message.rapidExecState.state == RAPID_RUNNING,
        message,
    )


def encode_command(mode: Mode, command: Command, seqno: int, time: float) -> bytes:
    """Writes a command to a controller.

    Args:
        mode: what to send.
        command: values, all that the mode sends.
        seqno: number of the message.
        time: of the sender's clock in s.

    Raises:
        EgmError: if a value that the mode sends is missing, not finite or of the wrong size.
    """
    if mode is Mode.PATH_CORRECTION:
        return _encode_path_correction(command, seqno, time)
    message = EgmSensor()
    _fill_header(message.header, seqno, time, CORRECTION)
    if mode.has_joints:
        degrees = map(math.degrees, _checked("position", command.position, (NUM_JOINTS,)).tolist())
        message.planned.joints.joints.extend(degrees)
    if mode.has_joint_speeds:
        speeds = map(math.degrees, _checked("velocity", command.velocity, (NUM_JOINTS,)).tolist())
        message.speedRef.joints.joints.extend(speeds)
    if mode.has_pose:
        if command.pose is None:
            raise EgmError("EGM command: this mode sends a pose, there is none")
        fill_pose(message.planned.cartesian, command.pose, mode.is_euler)
    if mode.has_pose_speed:
        sizes = (6,) if mode.is_euler else (6, 7)
        speed = _checked("pose_velocity", command.pose_velocity, sizes)
        turning = speed[3:] if len(speed) == 7 else speed[3:] * (180.0 / math.pi)
        message.speedRef.cartesians.value.extend([*(1e3 * speed[:3]).tolist(), *turning.tolist()])
    return message.SerializeToString()


def _encode_path_correction(command: Command, seqno: int, time: float) -> bytes:
    message = EgmSensorPathCorr()
    _fill_header(message.header, seqno, time, PATH_CORRECTION)
    x, y, z = (1e3 * _checked("path_correction", command.path_correction, (3,))).tolist()
    message.pathCorr.pos.x, message.pathCorr.pos.y, message.pathCorr.pos.z = x, y, z
    message.pathCorr.age = 1
    return message.SerializeToString()


def decode_command(data: bytes) -> tuple[int, Command]:
    """Decodes a command of a client: sequence number and content.

    Raises:
        EgmError: if it is not a command, or contains a number that is not finite.
    """
    try:
        message = EgmSensor.FromString(data)
        if message.header.mtype == PATH_CORRECTION:
            corrected = EgmSensorPathCorr.FromString(data)
            at = corrected.pathCorr.pos
            shift = 1e-3 * _checked("path correction", np.array([at.x, at.y, at.z]), (3,))
            return corrected.header.seqno, Command(path_correction=shift)
    except DecodeError as error:
        raise EgmError(f"not an EGM message: {error}") from error
    if not message.HasField("header") or message.header.mtype not in (COMMAND, CORRECTION):
        raise EgmError("an EGM message that is no command")
    joints, speeds = message.planned.joints.joints, message.speedRef.joints.joints
    pose_speed = message.speedRef.cartesians.value
    pose = _pose(message.planned.cartesian) if message.planned.HasField("cartesian") else None
    return message.header.seqno, Command(
        position=np.deg2rad(_checked("joints", np.array(joints), (NUM_JOINTS,))) if joints else None,
        velocity=np.deg2rad(_checked("joint speeds", np.array(speeds), (NUM_JOINTS,))) if speeds else None,
        pose=pose,
        pose_velocity=_si_speed(list(pose_speed)) if pose_speed else None,
    )


def _si_speed(wire: list[float]) -> np.ndarray:
    """The speed of a pose from the wire: of the position alone, with Euler angles or with a quaternion."""
    speed = _checked("pose speed", np.array(wire), (3, 6, 7))
    if len(speed) == 3:
        speed = np.concatenate([speed, np.zeros(3)])
    return np.concatenate([1e-3 * speed[:3], speed[3:] if len(speed) == 7 else np.deg2rad(speed[3:])])


def _fill_header(header: Any, seqno: int, time: float, mtype: int) -> None:
    header.seqno = seqno % _LARGEST_COUNT
    header.tm = int(1e3 * time) % _LARGEST_COUNT
    header.mtype = mtype


def fill_pose(wire: Any, pose: Pose, as_euler: bool = False) -> None:
    """Writes a pose into an ``EgmPose`` with the orientation in one form, never in both.

    Raises:
        EgmError: if the form is missing or a number is not finite.
    """
    x, y, z = (1e3 * _checked("pose", pose.position, (3,))).tolist()
    wire.pos.x, wire.pos.y, wire.pos.z = x, y, z
    if as_euler:
        about_z, about_y, about_x = np.rad2deg(_checked("Euler angles", pose.euler_zyx, (3,))).tolist()
        wire.euler.x, wire.euler.y, wire.euler.z = about_x, about_y, about_z
    else:
        quaternion = _checked("quaternion", pose.quaternion, (4,)).tolist()
        wire.orient.u0, wire.orient.u1, wire.orient.u2, wire.orient.u3 = quaternion


def _pose(wire: Any) -> Pose:
    """A pose from the wire; where Euler angles and a quaternion are there, the Euler angles count."""
    position = 1e-3 * _checked("pose", np.array([wire.pos.x, wire.pos.y, wire.pos.z]), (3,))
    if wire.HasField("euler"):
        angles = np.deg2rad([wire.euler.z, wire.euler.y, wire.euler.x])
        return Pose(position, euler_zyx=_checked("Euler angles", angles, (3,)))
    if not wire.HasField("orient"):
        raise EgmError("EGM pose: it has no orientation")
    q = wire.orient
    quaternion = _checked("quaternion", np.array([q.u0, q.u1, q.u2, q.u3]), (4,))
    size = float(np.linalg.norm(quaternion))
    if not 0.5 < size < 2.0:
        raise EgmError(f"EGM pose: a quaternion of length {size:.3g}")
    return Pose(position, quaternion / size)


def _checked(name: str, value: np.ndarray | None, sizes: tuple[int, ...]) -> np.ndarray:
    # A NaN is in no range.
    if value is None or len(value) not in sizes or not all(abs(each) <= _LARGEST for each in value.tolist()):
        allowed = " or ".join(str(size) for size in sizes)
        got = value if value is None or len(value) <= max(sizes) else f"{len(value)} of them"
        raise EgmError(f"EGM {name}: {allowed} finite numbers of at most {_LARGEST:g} are needed, got {got}")
    return value
