"""What a run logs: topics and their JSON schemas, which any reader of MCAP files understands.

Poses are Foxglove's ``PoseInFrame``. Times of messages are those of the path, in ns since its clock began.
What only a simulation can know stands under ``/truth``.
"""

from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

JOINTS, POSE, DESIRED = "/joint_sample", "/pose_sample", "/desired_pose"
COMMAND, CORRECTION, EVENT, PATH_TIME = "/command", "/correction", "/guard_event", "/path_time"
TRUE_POSE, TRUE_LINKS = "/truth/tip_pose", "/truth/link_position"
# Of recordings for `truetip identify`
MOTION, INERTIAL, TOLD = "/motion", "/inertial_sample", "/drive_command"

_NUMBER, _TEXT = {"type": "number"}, {"type": "string"}
_SIX = {"type": "array", "items": _NUMBER, "minItems": 6, "maxItems": 6}
_THREE = {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3}


def _record(title: str, **fields: dict[str, Any]) -> dict[str, Any]:
    return {"title": title, "type": "object", "properties": fields, "required": list(fields)}


_XYZ = _record("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POSE_IN_FRAME = _record(
    "foxglove.PoseInFrame",
    timestamp=_record("time", sec={"type": "integer"}, nsec={"type": "integer"}),
    frame_id=_TEXT,
    pose=_record(
        "foxglove.Pose",
        position=_XYZ,
        orientation=_record("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER),
    ),
)

# By topic. Units: rad, rad/s, N m, m, s.
SCHEMAS: dict[str, dict[str, Any]] = {
    # ``stamp``: the controller's clock, s; null in a simulation
    JOINTS: _record("truetip.JointSample", stamp={"type": ["number", "null"]}, position=_SIX, effort=_SIX),
    POSE: _POSE_IN_FRAME,  # its timestamp is the exposure, the message's time the arrival at a tick
    DESIRED: _POSE_IN_FRAME,
    COMMAND: _record("truetip.JointCommand", position=_SIX, velocity=_SIX),
    CORRECTION: _record("truetip.Correction", rotation=_THREE, translation=_THREE),
    PATH_TIME: _record("truetip.PathTime", time=_NUMBER),  # s on a path that is slowed
    EVENT: _record("truetip.GuardEvent", kind=_TEXT, detail=_TEXT),
    TRUE_POSE: _POSE_IN_FRAME,
    TRUE_LINKS: _record("truetip.LinkPosition", position=_SIX),
    MOTION: _record("truetip.Motion", name=_TEXT),  # begins here
    TOLD: _record("truetip.DriveCommand", position=_SIX, velocity=_SIX, torque=_SIX),  # side of the links
    # ``stamp``: the sensors' clock, s; x, y, z of each sensor, rad/s or m/s^2
    INERTIAL: _record("truetip.InertialSample", stamp=_NUMBER, readings={"type": "array", "items": _NUMBER}),
}


def pose_message(X_WE: np.ndarray, time: float) -> dict[str, Any]:
    """A pose (4, 4) in the world at a time in s."""
    X = RigidTransform(RotationMatrix(X_WE[:3, :3]), X_WE[:3, 3])
    w, x, y, z = X.rotation().ToQuaternion().wxyz().tolist()
    nanoseconds = max(0, round(1e9 * time))
    return {
        "timestamp": {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9},
        "frame_id": "world",
        "pose": {
            "position": dict(zip("xyz", X.translation().tolist(), strict=True)),
            "orientation": {"x": x, "y": y, "z": z, "w": w},
        },
    }
