"""The client's end of EGM."""

import numpy as np

from systems.link.abb.messages import Command, Mode, RobotReport
from systems.link.abb.session import EgmSession
from systems.link.client import LinkClient
from systems.link.udp_channel import Buffering, UdpChannel


class EgmClient(LinkClient[RobotReport]):
    """Receives the messages of a controller and replies to them."""

    session: EgmSession

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
        session = EgmSession(largest_speed, break_after, host, period)
        super().__init__(session, UdpChannel(port, address, buffering))

    def reply(self, mode: Mode, command: Command) -> bool:
        """Answers the newest report; False if it must not be, or has been, answered."""
        return self.answer((mode, command))

    def stop(self, mode: Mode, command: Command) -> bool:
        """Answers the controller's newest datagram, also a refused one; False if there is none to answer."""
        return self.answer_stopping((mode, command))
