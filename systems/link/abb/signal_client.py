"""Receives the test signals of a controller."""

from systems.link.abb.signals import ControllerSignals, SignalCodec, SignalError, SignalLayout
from systems.link.udp_channel import UdpChannel


class SignalClient:
    """Holds the newest test signals received."""

    def __init__(
        self, layout: SignalLayout, port: int = 0, address: str = "127.0.0.1", host: str | None = None
    ) -> None:
        """Listens.

        Args:
            layout: how a datagram is written.
            port: where the controller sends them, 0 for any free one.
            address: of the interface to listen on.
            host: address of the controller, None to take whoever sends.

        Raises:
            SignalError: if there cannot be such a layout.
            ChannelError: if it cannot listen there.
        """
        self._codec = SignalCodec(layout)
        self._host = host
        self.channel = UdpChannel(port, address)
        self.newest: ControllerSignals | None = None
        self.received = self.undecodable = self.foreign = 0

    def poll(self) -> None:
        """Takes what has arrived; never waits."""
        for data, sender in self.channel.receive():
            if self._host is not None and sender[0] != self._host:
                self.foreign += 1
                continue
            try:
                self.newest = self._codec.decode(data)
                self.received += 1
            except SignalError:
                self.undecodable += 1

    def close(self) -> None:
        """Frees the port."""
        self.channel.close()

    def __enter__(self) -> "SignalClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
