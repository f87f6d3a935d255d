# A None where there should be something fails a test as it should.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportAttributeAccessIssue=false
"""EGM on the wire: what we write others read, what others write we read, and nothing else gets through."""

import struct
import subprocess
import sys
from contextlib import suppress
from functools import partial

import numpy as np
import pytest
from ABBRobotEGM._egm_protobuf import egm_pb2  # registers an egm.proto of its own: it must not clash
from hypothesis import given
from hypothesis import strategies as st

from systems.link.abb.messages import (
    Command,
    EgmError,
    Mode,
    Pose,
    decode_command,
    decode_report,
    encode_command,
)
from systems.link.abb.schema import EgmRobot, EgmSensor
from tests.systems.link.abb.reports import report

angles = st.lists(st.floats(-6.0, 6.0), min_size=6, max_size=6).map(np.array)
POSE = Pose(
    np.array([0.5, -0.2, 0.7]), np.array([0.5, 0.5, -0.5, 0.5]), np.deg2rad(np.array([30.0, -20.0, 10.0]))
)
EVERYTHING = Command(
    np.deg2rad(np.arange(6.0)), np.deg2rad(np.arange(6.0, 12.0)), POSE, np.full(6, 0.1), np.full(3, 1e-3)
)
# Which of joints, joint speeds, quaternion, Euler angles and speeds of the pose a mode sends: table A.6.
SENT = {
    Mode.JOINT: "j....",
    Mode.JOINT_SPEED: "js...",
    Mode.JOINT_SPEED_ONLY: ".s...",
    Mode.POSE_EULER: "...e.",
    Mode.POSE_EULER_SPEED: "...ep",
    Mode.POSE_EULER_SPEED_ONLY: "....p",
    Mode.POSE_QUAT: "..q..",
    Mode.POSE_QUAT_SPEED: "..q.p",
    Mode.POSE_QUAT_SPEED_ONLY: "....p",
    Mode.SPEED: ".s..p",
    Mode.ALL: "jsq.p",
}


@pytest.mark.parametrize(("mode", "sent"), SENT.items(), ids=lambda value: getattr(value, "value", ""))
def test_every_mode_sends_what_its_name_says_and_nothing_more(mode: Mode, sent: str):
    message = egm_pb2.EgmSensor.FromString(encode_command(mode, EVERYTHING, 7, 1.5))
    planned, speed = message.planned, message.speedRef
    found = [
        "j" if planned.HasField("joints") else ".",
        "s" if speed.HasField("joints") else ".",
        "q" if planned.cartesian.HasField("orient") else ".",
        "e" if planned.cartesian.HasField("euler") else ".",
        "p" if speed.HasField("cartesians") else ".",
    ]
    assert "".join(found) == sent
    assert (message.header.seqno, message.header.tm) == (7, 1500)
    assert message.header.mtype == egm_pb2.EgmHeader.MSGTYPE_CORRECTION


def test_others_read_degrees_and_millimetres_with_w_first():
    message = egm_pb2.EgmSensor.FromString(encode_command(Mode.ALL, EVERYTHING, 7, 0.0))
    np.testing.assert_allclose(message.planned.joints.joints, np.arange(6.0), atol=1e-12)
    np.testing.assert_allclose(message.speedRef.joints.joints, np.arange(6.0, 12.0))
    pos, orient = message.planned.cartesian.pos, message.planned.cartesian.orient
    np.testing.assert_allclose([pos.x, pos.y, pos.z], [500.0, -200.0, 700.0])
    assert [orient.u0, orient.u1, orient.u2, orient.u3] == [0.5, 0.5, -0.5, 0.5]
    np.testing.assert_allclose(message.speedRef.cartesians.value[:3], 100.0)
    np.testing.assert_allclose(message.speedRef.cartesians.value[3:], np.rad2deg(0.1))


def test_a_path_correction_is_a_message_of_its_own():
    data = encode_command(Mode.PATH_CORRECTION, EVERYTHING, 9, 0.0)
    message = egm_pb2.EgmSensorPathCorr.FromString(data)
    assert message.pathCorr.pos.x == pytest.approx(1.0)
    np.testing.assert_allclose(decode_command(data)[1].path_correction, 1e-3)


@given(position=angles, velocity=angles)
def test_a_command_comes_out_as_it_went_in(position: np.ndarray, velocity: np.ndarray):
    seqno, command = decode_command(encode_command(Mode.JOINT_SPEED, Command(position, velocity), 3, 0.0))
    assert seqno == 3
    np.testing.assert_allclose(command.position, position, atol=1e-14)
    np.testing.assert_allclose(command.velocity, velocity, atol=1e-14)


def test_where_both_are_sent_the_euler_angles_count():
    message = EgmSensor.FromString(encode_command(Mode.POSE_QUAT, EVERYTHING, 1, 0.0))
    message.planned.cartesian.euler.x = message.planned.cartesian.euler.y = 0.0
    message.planned.cartesian.euler.z = 90.0
    _, command = decode_command(message.SerializeToString())
    assert command.pose.quaternion is None
    np.testing.assert_allclose(command.pose.euler_zyx, [np.pi / 2.0, 0.0, 0.0])


def test_a_report_of_another_implementation_is_read():
    message = egm_pb2.EgmRobot()
    message.header.seqno, message.header.tm, message.header.mtype = 12, 34567, 2
    message.feedBack.joints.joints.extend([10.0, 20.0, 30.0, 40.0, 50.0, 60.0])
    message.feedBack.externalJoints.joints.append(-7.0)
    message.feedBack.cartesian.pos.x = message.feedBack.cartesian.pos.y = 100.0
    message.feedBack.cartesian.pos.z = 1000.0
    message.feedBack.cartesian.orient.u0 = 1.0
    message.feedBack.cartesian.orient.u1 = message.feedBack.cartesian.orient.u2 = 0.0
    message.feedBack.cartesian.orient.u3 = 0.0
    message.motorState.state, message.mciState.state, message.rapidExecState.state = 1, 3, 2
    message.mciConvergenceMet = True
    message.measuredForce.fcActive = True
    message.measuredForce.force.extend([1.0, 2.0, 3.0])
    message.testSignals.signals.extend([0.5, 0.25])
    found = decode_report(message.SerializeToString())
    assert (found.seqno, found.time) == (12, 34.567)
    assert found.is_ready
    assert found.rapid_running
    assert found.converged
    np.testing.assert_allclose(np.rad2deg(found.position), [10.0, 20.0, 30.0, 40.0, 50.0, 60.0])
    np.testing.assert_allclose(found.pose.position, [0.1, 0.1, 1.0])
    assert found.force == [1.0, 2.0, 3.0]
    assert found.external_position.tolist() == [-7.0]
    assert found.test_signals.tolist() == [0.5, 0.25]


def with_force(force: bytes) -> bytes:
    """A report with field 9, the measured force, as these bytes."""
    return report(1) + bytes([9 << 3 | 2, len(force)]) + force


def test_the_force_of_robotware_6_and_of_robotware_7_is_read():
    """RobotWare 6: repeated double force = 1; RobotWare 7: bool fcActive = 1, repeated double force = 2."""
    older = b"".join(bytes([1 << 3 | 1]) + struct.pack("<d", value) for value in (4.0, 5.0))
    newer = bytes([1 << 3, 1]) + b"".join(
        bytes([2 << 3 | 1]) + struct.pack("<d", value) for value in (4.0, 5.0)
    )
    assert decode_report(with_force(older)).force == [4.0, 5.0]
    assert decode_report(with_force(newer)).force == [4.0, 5.0]
    assert decode_report(with_force(bytes([1 << 3, 0]))).force == []


def test_without_a_clock_in_the_feedback_the_header_s_counts():
    message = EgmRobot.FromString(report(5, time=2.5))
    message.feedBack.ClearField("time")
    assert decode_report(message.SerializeToString()).time == 2.5


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e9])
def test_a_report_with_an_impossible_joint_is_refused(number: float):
    with pytest.raises(EgmError, match="joint angles"):
        decode_report(report(1, np.array([0.0, number, 0.0, 0.0, 0.0, 0.0])))


def test_a_robot_with_another_number_of_joints_is_refused():
    with pytest.raises(EgmError, match="7 joints, the robot has 6"):
        decode_report(report(1, np.zeros(7)))


@pytest.mark.parametrize(
    ("mode", "command"),
    [
        (Mode.JOINT, Command()),
        (Mode.JOINT, Command(np.full(6, np.nan))),
        (Mode.JOINT_SPEED, Command(np.zeros(6), np.zeros(5))),
        (Mode.POSE_QUAT, Command(np.zeros(6))),
        (Mode.POSE_QUAT, Command(pose=Pose(np.zeros(3), euler_zyx=np.zeros(3)))),
        (Mode.PATH_CORRECTION, Command(path_correction=np.array([0.0, np.inf, 0.0]))),
    ],
)
def test_a_command_that_is_not_finite_or_not_there_never_becomes_bytes(mode: Mode, command: Command):
    with pytest.raises(EgmError):
        encode_command(mode, command, 1, 0.0)


def finite(numbers: np.ndarray | None, *sizes: int) -> bool:
    """Whether numbers are as many as they may be and all finite, or not there at all."""
    return numbers is None or (len(numbers) in sizes and bool(np.isfinite(numbers).all()))


MESSAGES = [report(1), *(encode_command(mode, EVERYTHING, 1, 0.0) for mode in Mode)]
DAMAGE = st.binary(min_size=1, max_size=3) | st.sampled_from([np.nan, np.inf]).map(partial(struct.pack, "<d"))


@st.composite
def datagrams(draw: st.DrawFn) -> bytes:
    """Random bytes, and messages in which some bytes are others; some of these NaN or infinite."""
    data = bytearray(draw(st.binary(max_size=400) | st.sampled_from(MESSAGES)))
    for place, other in draw(st.lists(st.tuples(st.integers(0, 150), DAMAGE), max_size=2)):
        data[place : place + len(other)] = other
    return bytes(data)


@given(data=datagrams())
def test_only_finite_numbers_get_through_and_all_else_is_one_kind_of_error(data: bytes):
    with suppress(EgmError):
        found = decode_report(data)
        assert finite(found.position, 6)
        assert np.isfinite(found.time)
    with suppress(EgmError):
        _, command = decode_command(data)
        assert finite(command.position, 6)
        assert finite(command.velocity, 6)
        assert finite(command.pose_velocity, 6, 7)
        assert finite(command.path_correction, 3)
        if command.pose:
            assert finite(command.pose.position, 3)
            assert finite(command.pose.quaternion, 4)
            assert finite(command.pose.euler_zyx, 3)


def test_both_foreign_packages_load_beside_ours():
    """Each registers egm.proto in the common pool; ours must not mind, in any order."""
    ours = "systems.link.abb.schema"
    for order in (f"abb_robot_client.egm, {ours}", f"{ours}, ABBRobotEGM"):
        done = subprocess.run([sys.executable, "-c", f"import {order}"], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
