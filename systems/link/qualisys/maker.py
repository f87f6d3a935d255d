"""A Qualisys camera system: the client and the virtual server that a station takes from its configuration."""

from dataclasses import dataclass, replace

from pydrake.math import RigidTransform

from systems.link.qualisys.receiver import MocapReceiver, MocapReceiverConfig
from systems.link.qualisys.server import CameraServerConfig, VirtualCameraServer


@dataclass
class Qualisys(MocapReceiverConfig):
    """A camera server, its clock, and the body it tracks."""

    def connect(
        self, X_WM: RigidTransform, X_BE: RigidTransform, delay: float, port: int | None = None
    ) -> MocapReceiver:
        """The client; its first poll connects it.

        Args:
            X_WM: the camera system's frame in the world.
            X_BE: the tool in the frame of the tracked body.
            delay: s, from exposure to arrival over an idle line.
            port: of the server; None for the configured one.

        Raises:
            ValueError: if the configuration is not possible.
        """
        server = self.server if port is None else replace(self.server, port=port)
        config = MocapReceiverConfig(server, replace(self.clock, smallest_delay=delay), self.oldest)
        return MocapReceiver(config, X_WM, X_BE)

    def virtual_server(self, period: float) -> "BodyServer":
        """A server that publishes the one body, every ``period`` in s."""
        server = self.server
        config = CameraServerConfig(
            bodies=[server.body], address=server.address, port=server.port, frequency=round(1.0 / period)
        )
        return BodyServer(config)


class BodyServer(VirtualCameraServer):
    """A virtual server of a single body; fits `systems.link.protocols.VirtualPoseSource`."""

    def __init__(self, config: CameraServerConfig) -> None:
        """Listens. Raises ValueError as `VirtualCameraServer`."""
        super().__init__(config)
        self._body = config.bodies[0]

    @property
    def place(self) -> str:
        """Where it listens."""
        address, port = self.address
        return f"TCP {address}:{port}"

    def publish_body(self, time_us: int, number: int, X_WE: RigidTransform | None, residual: float) -> None:
        """Sends a frame to all clients; None for a body that is not seen."""
        self.publish(time_us, number, {self._body: X_WE}, {self._body: residual})
