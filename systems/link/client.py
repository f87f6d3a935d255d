"""The client's end of a guided robot: socket and session together."""

from typing import Any, Generic

from systems.link.clock import steady_time
from systems.link.session import LinkSession, Report
from systems.link.udp_channel import UdpChannel


class LinkClient(Generic[Report]):
    """Receives the messages of a controller and replies to them."""

    def __init__(self, session: LinkSession[Report], channel: UdpChannel) -> None:
        """Takes over a socket that is open."""
        self.session, self.channel = session, channel
        self.arrived = 0.0  # steady time at which the newest report came, in s

    def poll(self, timeout: float = 0.0) -> Report | None:
        """The newest report that has come since the last call, waiting for at most ``timeout`` in s."""
        # Not by the message that ends it: that may have come together with those that were refused.
        self.session.forget_trouble()
        if not self.channel.wait(timeout):
            self.session.check(steady_time())
            return None
        now, newest = steady_time(), None
        for data, sender in self.channel.receive():
            report = self.session.receive(data, sender, now)
            if report is not None:
                if newest is not None:
                    self.session.counters.superseded += 1
                newest, self.arrived = report, now
        self.session.check(now)
        return newest

    def answer(self, command: Any) -> bool:
        """Answers the newest report; False if it must not be, or has been, answered."""
        return self._send(self.session.answer(command, steady_time()))

    def answer_stopping(self, command: Any) -> bool:
        """Answers the controller's newest datagram, also a refused one; False if there is none to answer."""
        return self._send(self.session.answer_stopping(command, steady_time()))

    def warm_up(self) -> None:
        """Reads the last report and writes the last command once more, so that the next ones find it warm."""
        self.session.warm_up()

    def close(self) -> None:
        """Frees the port."""
        self.channel.close()

    def _send(self, data: bytes | None) -> bool:
        sender = self.session.sender
        return data is not None and sender is not None and self.channel.send(data, sender)

    def __enter__(self):
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
