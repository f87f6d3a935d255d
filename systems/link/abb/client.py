"""The client's end of EGM: socket and session together."""

import numpy as np

from systems.link.abb.messages import Command, Mode, RobotReport
from systems.link.abb.session import EgmSession
from systems.link.clock import steady_time
from systems.link.udp_channel import Buffering, UdpChannel


class EgmClient:
    """Receives the messages of a controller and replies to them."""

    def __init__(
        self,
        largest_speed: np.ndarray,
        port: int = 0,
        address: str = "127.0.0.1",
        host: str | None = None,
        break_after: float = 0.1,
        buffering: Buffering = Buffering.NEWEST,
        period: float = 4e-3,
    ) -> None:
        """Listens.

        Args:
            largest_speed: of the joints in rad/s, shape (6,).
            port: where the controller sends to, 0 for any free one.
            address: of the interface to listen on.
            host: address of the controller, None to take whoever speaks first.
            break_after: silence in s after which the stream counts as broken.
            buffering: what to do with messages that wait.
            period: shortest time between two messages in s.

        Raises:
            ChannelError: if it cannot listen there.
            ValueError: if ``break_after`` is not positive.
        """
        self.session = EgmSession(largest_speed, break_after, host, period)
        self.channel = UdpChannel(port, address, buffering)
        self.arrived = 0.0  # steady time at which the newest report came, in s

    def poll(self, timeout: float = 0.0) -> RobotReport | None:
        """The newest report that has come since the last call, waiting for at most ``timeout`` in s."""
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

    def reply(self, mode: Mode, command: Command) -> bool:
        """Answers the newest report; False if it must not be, or has been, answered."""
        data, sender = self.session.reply(mode, command, steady_time()), self.session.sender
        return data is not None and sender is not None and self.channel.send(data, sender)

    def stop(self, mode: Mode, command: Command) -> bool:
        """Answers the controller's newest datagram, also a refused one; False if there is none to answer."""
        data, sender = self.session.stop(mode, command, steady_time()), self.session.sender
        return data is not None and sender is not None and self.channel.send(data, sender)

    def warm_up(self) -> None:
        """Reads the last report and writes the last command once more, so that the next ones find it warm."""
        self.session.warm_up()

    def close(self) -> None:
        """Frees the port."""
        self.channel.close()

    def __enter__(self) -> "EgmClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
