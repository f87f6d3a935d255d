"""The messages of Externally Guided Motion on the wire, in a pool of their own.

Any other package may register an ``egm.proto`` too; a private descriptor pool never meets it. The fields
and numbers are those of the ``egm.proto`` that comes with RobotWare; both generations, 6 and 7, are read.
They differ in what lies in the measured force, which is therefore kept as bytes, see `measured_force`.

They are a table here and not a compiled ``egm.proto``: compiled code works only with the protobuf runtimes
that its compiler supports, and compiling at installation needs that compiler. In the tests, clients of other
authors with compiled code of their own talk to this one.
"""

from typing import Any

from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import DecodeError
from google.protobuf.message_factory import GetMessageClass

_PACKAGE = "abb.egm"
_LABELS = {
    "optional": FieldDescriptorProto.LABEL_OPTIONAL,
    "required": FieldDescriptorProto.LABEL_REQUIRED,
    "repeated": FieldDescriptorProto.LABEL_REPEATED,
}
_TYPES = {
    "bool": FieldDescriptorProto.TYPE_BOOL,
    "bytes": FieldDescriptorProto.TYPE_BYTES,
    "double": FieldDescriptorProto.TYPE_DOUBLE,
    "uint32": FieldDescriptorProto.TYPE_UINT32,
    "uint64": FieldDescriptorProto.TYPE_UINT64,
}
# An enumeration is read as a number: one that a later RobotWare adds must not vanish from the message.
_MESSAGES = """
EgmHeader
    optional uint32 seqno = 1
    optional uint32 tm = 2
    optional uint32 mtype = 3
EgmCartesian
    required double x = 1
    required double y = 2
    required double z = 3
EgmQuaternion
    required double u0 = 1
    required double u1 = 2
    required double u2 = 3
    required double u3 = 4
EgmEuler
    required double x = 1
    required double y = 2
    required double z = 3
EgmClock
    required uint64 sec = 1
    required uint64 usec = 2
EgmTimestamp
    optional uint64 sec = 1
    optional uint64 nsec = 2
EgmPose
    optional EgmCartesian pos = 1
    optional EgmQuaternion orient = 2
    optional EgmEuler euler = 3
EgmCartesianSpeed
    repeated double value = 1
EgmJoints
    repeated double joints = 1
EgmPlanned
    optional EgmJoints joints = 1
    optional EgmPose cartesian = 2
    optional EgmJoints externalJoints = 3
    optional EgmClock time = 4
    optional EgmTimestamp timeStamp = 5
EgmSpeedRef
    optional EgmJoints joints = 1
    optional EgmCartesianSpeed cartesians = 2
    optional EgmJoints externalJoints = 3
EgmPathCorr
    required EgmCartesian pos = 1
    required uint32 age = 2
EgmFeedBack
    optional EgmJoints joints = 1
    optional EgmPose cartesian = 2
    optional EgmJoints externalJoints = 3
    optional EgmClock time = 4
    optional EgmTimestamp timeStamp = 5
EgmMotorState
    required uint32 state = 1
EgmMCIState
    required uint32 state = 1
EgmRapidCtrlExecState
    required uint32 state = 1
EgmTestSignals
    repeated double signals = 1
EgmMeasuredForceRw6
    repeated double force = 1
EgmMeasuredForceRw7
    optional bool fcActive = 1
    repeated double force = 2
EgmCollisionInfo
    optional bool collsionTriggered = 1
    repeated double collDetQuota = 2
EgmRAPIDdata
    optional bool digVal = 1
    repeated double dnum = 2
EgmRobot
    optional EgmHeader header = 1
    optional EgmFeedBack feedBack = 2
    optional EgmPlanned planned = 3
    optional EgmMotorState motorState = 4
    optional EgmMCIState mciState = 5
    optional bool mciConvergenceMet = 6
    optional EgmTestSignals testSignals = 7
    optional EgmRapidCtrlExecState rapidExecState = 8
    optional bytes measuredForce = 9
    optional double utilizationRate = 10
    optional uint32 moveIndex = 11
    optional EgmCollisionInfo CollisionInfo = 12
    optional EgmRAPIDdata RAPIDfromRobot = 13
    optional EgmJoints torqueRef = 14
EgmSensor
    optional EgmHeader header = 1
    optional EgmPlanned planned = 2
    optional EgmSpeedRef speedRef = 3
    optional EgmRAPIDdata RAPIDtoRobot = 4
EgmSensorPathCorr
    optional EgmHeader header = 1
    optional EgmPathCorr pathCorr = 2
"""

# EgmHeader.mtype
COMMAND, DATA, CORRECTION, PATH_CORRECTION = 1, 2, 3, 4
# EgmMotorState.state, EgmMCIState.state, EgmRapidCtrlExecState.state
MOTORS_ON, MOTORS_OFF = 1, 2
MCI_ERROR, MCI_STOPPED, MCI_RUNNING = 1, 2, 3
RAPID_STOPPED, RAPID_RUNNING = 1, 2


def _file() -> FileDescriptorProto:
    """The table above as a file descriptor."""
    file = FileDescriptorProto(name="truetip/egm.proto", package=_PACKAGE, syntax="proto2")
    for line in _MESSAGES.strip().splitlines():
        words = line.split()
        if len(words) == 1:
            message = file.message_type.add(name=words[0])
            continue
        label, kind, name, _, number = words
        field = message.field.add(name=name, number=int(number), label=_LABELS[label])
        if kind in _TYPES:
            field.type = _TYPES[kind]
        else:
            field.type, field.type_name = FieldDescriptorProto.TYPE_MESSAGE, f".{_PACKAGE}.{kind}"
    return file


_POOL = DescriptorPool()
_POOL.AddSerializedFile(_file().SerializeToString())


def _message(name: str) -> Any:
    """The class of a message; built at run time, so its attributes are not known to a type checker."""
    return GetMessageClass(_POOL.FindMessageTypeByName(f"{_PACKAGE}.{name}"))


EgmRobot = _message("EgmRobot")
EgmSensor = _message("EgmSensor")
EgmSensorPathCorr = _message("EgmSensorPathCorr")
_EgmMeasuredForceRw6 = _message("EgmMeasuredForceRw6")
_EgmMeasuredForceRw7 = _message("EgmMeasuredForceRw7")


def measured_force(data: bytes) -> list[float]:
    """The force (N and N m) in the bytes of ``measuredForce``, of RobotWare 6 or 7; empty if there is none.

    RobotWare 6 has the numbers in field 1, where 7 has whether the force is measured at all.

    Raises:
        google.protobuf.message.DecodeError: if it is neither.
    """
    newer = _EgmMeasuredForceRw7.FromString(data)
    if newer.force or newer.HasField("fcActive"):
        return list(newer.force) if newer.fcActive or not newer.HasField("fcActive") else []
    return list(_EgmMeasuredForceRw6.FromString(data).force)


__all__ = ["DecodeError", "EgmRobot", "EgmSensor", "EgmSensorPathCorr", "measured_force"]
