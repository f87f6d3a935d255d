"""What the links of all makers have in common: the state of their client."""

from typing import Generic

from systems.link.client import LinkClient
from systems.link.session import Report


class GuidedRobot(Generic[Report]):
    """The part of `systems.link.protocols.RobotLink` that does not depend on the maker."""

    def __init__(self, client: LinkClient[Report]) -> None:
        """Takes over a socket that is open."""
        self._client = client

    @property
    def arrived(self) -> float:
        """Steady time at which the newest report came, in s."""
        return self._client.arrived

    @property
    def place(self) -> str:
        """Where the controller is waited for."""
        address, port = self._client.channel.address
        return f"UDP {address}:{port}"

    @property
    def epoch(self) -> int:
        """Grows whenever commands must start anew."""
        return self._client.session.epoch

    @property
    def utilization(self) -> float:
        """How much of its performance the robot needs; 0 where it does not say so."""
        return 0.0

    @property
    def heard(self) -> float:
        """Steady time at which anything last came from the controller, in s."""
        return self._client.session.heard

    @property
    def heard_stamp(self) -> float:
        """What the controller's clock showed in that, in s."""
        return self._client.session.heard_stamp

    @property
    def trouble(self) -> str:
        """Why the controller's newest messages are refused, or commands had to start anew; else empty."""
        return self._client.session.trouble

    def _unheard(self, what: str) -> str:
        """That nothing came, or why what came was of no use; ``what`` says the first."""
        refused = self._client.session.refused
        return f"{what} that can be used ({refused})" if refused else what

    def warm_up(self) -> None:
        """Reads the last report and writes the last command once more."""
        self._client.warm_up()

    def counters(self) -> dict[str, int]:
        """What has come and gone, by name."""
        return self._client.session.counters.as_dict()
