"""The topics of a run as it goes on, for Foxglove and whatever else speaks its protocol."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.math import RotationMatrix

from diagrams.record.topics import JOINTS, SCHEMAS
from robots.description.model import RobotModel
from robots.kinematics.arm_capsules import ArmCapsules

PORT = 8765  # of Foxglove
SCENE = "/scene"  # robot and path, as entities
_EVERY = 0.03  # s between two pictures of the robot
_SHORT = 1e-9  # m


class FoxgloveServer:
    """Sends what is logged to viewers on the network, beside the record on disk; a `RunRecord` tells it.

    Messages are those of `diagrams.record.topics.SCHEMAS`; ``/scene`` shows the robot at its measured joints
    and the wanted path. Sending happens in the server's own thread; a viewer that is too slow loses messages,
    and the run does not wait for it.
    """

    def __init__(self, address: str, robot: RobotModel) -> None:
        """Opens the server.

        Args:
            address: ``PORT`` or ``HOST:PORT``; loopback unless a host is named.
            robot: to be shown.

        Raises:
            ValueError: if the address cannot be read, or ``foxglove-sdk`` is not installed.
            OSError: if the port is taken.
        """
        host, port = _host_and_port(address)
        try:
            import foxglove
            import foxglove.channels
            import foxglove.messages
        except ImportError as error:
            raise ValueError(
                "--foxglove needs the package foxglove-sdk: pip install 'truetip[live]'"
            ) from error
        foxglove.set_log_level("ERROR")
        # A context of its own: what other code of this process logs is not ours to send.
        self._context = foxglove.Context()
        try:
            self._server = foxglove.start_server(name="truetip", host=host, port=port, context=self._context)
        except RuntimeError as error:
            raise OSError(f"--foxglove {host}:{port}: {error}") from error
        self._foxglove = foxglove
        self._arm = ArmCapsules(robot)
        self._shown = -np.inf
        self._channels: dict[str, Any] = {}
        self._scene = foxglove.channels.SceneUpdateChannel(SCENE, context=self._context)
        self.address = f"ws://{host}:{self._server.port}"

    def show_path(self, p_W: np.ndarray) -> None:
        """Draws the wanted path through points (n, 3) in m."""
        m = self._foxglove.messages
        line = m.LinePrimitive(
            type=m.LinePrimitiveLineType.LineStrip,
            thickness=2.0,
            scale_invariant=True,
            points=[m.Point3(x=x, y=y, z=z) for x, y, z in p_W.tolist()],
            color=m.Color(r=0.1, g=0.5, b=0.45, a=1.0),
        )
        self._scene.log(m.SceneUpdate(entities=[m.SceneEntity(id="path", frame_id="world", lines=[line])]))

    def write(self, topic: str, at: float, message: Mapping[str, Any]) -> None:
        """Sends a message of a topic of `SCHEMAS` at a time of the path in s."""
        channel = self._channels.get(topic)
        if channel is None:
            schema = {"type": "object", **SCHEMAS[topic]}
            channel = self._channels[topic] = self._foxglove.Channel(
                topic, schema=schema, message_encoding="json", context=self._context
            )
        if channel.has_sinks():
            channel.log(json.dumps(message).encode(), log_time=_nanoseconds(at))
        if topic == JOINTS and at >= self._shown + _EVERY:
            self._shown = at
            if self._scene.has_sinks():
                self._show_arm(np.array(message["position"]), at)

    def close(self) -> None:
        """Ends the server."""
        self._server.stop()

    def _show_arm(self, q: np.ndarray, at: float) -> None:
        m, capsules = self._foxglove.messages, self._arm.at(q)
        colour = m.Color(r=0.95, g=0.55, b=0.15, a=1.0)
        links, joints = [], []
        for start, end, radius in zip(capsules.start, capsules.end, capsules.radius.tolist(), strict=True):
            along = end - start
            length = float(np.linalg.norm(along))
            joints.append(
                m.SpherePrimitive(pose=_pose(m, end), size=_vector(m, [2.0 * radius] * 3), color=colour)
            )
            if length > _SHORT:
                R = RotationMatrix.MakeFromOneVector(along, 2)
                links.append(
                    m.CylinderPrimitive(
                        pose=_pose(m, 0.5 * (start + end), R),
                        size=_vector(m, [2.0 * radius, 2.0 * radius, length]),
                        bottom_scale=1.0,
                        top_scale=1.0,
                        color=colour,
                    )
                )
        arm = m.SceneEntity(id="robot", frame_id="world", cylinders=links, spheres=joints)
        self._scene.log(m.SceneUpdate(entities=[arm]), log_time=_nanoseconds(at))


def _nanoseconds(at: float) -> int:
    return max(0, round(1e9 * at))


def _vector(m: Any, xyz: list[float]) -> Any:
    return m.Vector3(x=xyz[0], y=xyz[1], z=xyz[2])


def _pose(m: Any, p: np.ndarray, R: RotationMatrix | None = None) -> Any:
    w, x, y, z = (R or RotationMatrix()).ToQuaternion().wxyz().tolist()
    return m.Pose(position=_vector(m, p.tolist()), orientation=m.Quaternion(x=x, y=y, z=z, w=w))


def _host_and_port(address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    if not port.isdecimal() or not 0 <= int(port) < 65536:
        raise ValueError(f"--foxglove must be PORT or HOST:PORT, got '{address}'")
    return host or "127.0.0.1", int(port)
