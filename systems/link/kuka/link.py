"""KUKA's Robot Sensor Interface: what a scenario says of it, and the parts that a station takes from it."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from robots.configuration.quantity import quantity
from robots.description.model import RobotModel
from systems.link.client import LinkClient
from systems.link.kuka.controller import RsiController, RsiRunConfig
from systems.link.kuka.motion import RsiMotion, RsiMotionConfig
from systems.link.kuka.robot_link import KukaRobotLink, RsiCodec, RsiReport
from systems.link.protocols import Wire
from systems.link.session import LinkSession
from systems.link.udp_channel import UdpChannel
from systems.reference.cartesian_path import CartesianPath

_CYCLES = (4, 12)  # ms


@dataclass
class RsiSettings:
    """Of the controller; with `systems.link.config.LinkConfig` it is a link."""

    cycle_ms: int = quantity(4, 4, 12, "ms")  # 4 or 12; equal to the station's period
    # Replies before a telegram that its set-point ASPos does not contain; found anew from the set-points
    behind: int = quantity(1, 0, 10)
    sentype: str = "ImFree"  # the name of the sensor in the controller's configuration
    motion: RsiMotionConfig = field(default_factory=RsiMotionConfig)
    run: RsiRunConfig = field(default_factory=RsiRunConfig)

    def check(self) -> None:
        """Refuses a cycle that RSI does not have, or a name that would break the telegram.

        Raises:
            ValueError: one line.
        """
        if self.cycle_ms not in _CYCLES:
            raise ValueError(f"cycle_ms must be 4 or 12, got {self.cycle_ms}")
        if not self.sentype.isalnum():
            raise ValueError(f"sentype must be letters and digits, got '{self.sentype}'")

    def planner(self, period: float, takes_position: bool) -> RsiMotion:
        """What plans between commands and drives, as the controller does.

        Raises:
            ValueError: if the period is not RSI's cycle.
        """
        self._check_period(period)
        return RsiMotion(self.motion, period, takes_position)

    def virtual_controller(
        self, robot: RobotModel, path: CartesianPath | None = None, home: np.ndarray | None = None
    ) -> RsiController:
        """The controller's end of the wire, before a simulated robot; its program runs no path."""
        return RsiController(robot, self.run)

    @contextmanager
    def open(self, robot: RobotModel, wire: Wire) -> Iterator[KukaRobotLink]:
        """The client's end of the wire, for as long as the block lasts.

        Raises:
            ChannelError: if it cannot listen there.
            ValueError: if the period is not RSI's cycle.
        """
        self._check_period(wire.period)
        codec = RsiCodec(
            robot.speed, wire.period, self.run.correction == "relative", self.sentype, self.behind
        )
        session = LinkSession[RsiReport](
            codec, robot.speed, wire.break_after, wire.controller or None, wire.period
        )
        with LinkClient(session, UdpChannel(wire.port, wire.address)) as client:
            yield KukaRobotLink(client)

    def _check_period(self, period: float) -> None:
        if abs(1e3 * period - self.cycle_ms) > 1e-6:
            raise ValueError(
                f"station.period={period:g} s must be the cycle of RSI, station.link.cycle_ms={self.cycle_ms}"
            )
