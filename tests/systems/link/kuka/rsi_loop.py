"""A client and the virtual controller under RSI, cycle by cycle as the cell runs it, without sockets."""

from collections.abc import Callable

import numpy as np

from robots.description.model import load_robot
from systems.link.kuka.controller import RsiController, RsiRunConfig
from systems.link.kuka.robot_link import RsiCodec, RsiCommand, RsiReport
from systems.link.session import LinkSession

ROBOT = load_robot("kr16")
CYCLE = 0.004
START = np.deg2rad([0.0, -90.0, 100.0, 0.0, 80.0, 0.0])
SENDER = ("127.0.0.1", 59152)


class RsiLoop:
    """Joints that are where the controller's reference was in the cycle before, less a following error."""

    def __init__(self, following_error: np.ndarray | None = None, **settings) -> None:
        config = RsiRunConfig(**settings)
        self.controller = RsiController(ROBOT, config)
        self._is_relative = config.correction == "relative"
        self.following_error = np.zeros(6) if following_error is None else following_error  # rad
        self.change_client()
        self.time, self.planned = 100.0, START.copy()
        self._coming = self._report()

    @property
    def measured(self) -> np.ndarray:
        """Where the joints are, (6,) rad."""
        return self.planned - self.following_error

    def change_client(self) -> None:
        """A new client comes; the last reply of the one before is lost."""
        codec = RsiCodec(ROBOT.speed, CYCLE, self._is_relative, "ImFree")
        self.session = LinkSession[RsiReport](codec, ROBOT.speed, period=CYCLE)
        self._reply: bytes | None = None

    def run(
        self,
        cycles: int,
        command: Callable[[float], np.ndarray],
        is_lost: Callable[[int], bool] = lambda cycle: False,
    ) -> np.ndarray:
        """The planned positions, (cycles, 6); ``command`` is of the time in s since the start."""
        start, planned = self.time, np.empty((cycles, 6))
        for cycle in range(cycles):
            if self._reply is not None:
                self.controller.receive(self._reply, self.time, self.planned)
            self.controller.cycle(self.time, self.planned)
            report, self._coming = self._coming, None
            self._reply = None
            if report is not None and self.session.receive(report, SENDER, self.time):
                wanted = RsiCommand(command(self.time - start), np.zeros(6))
                reply = self.session.answer(wanted, self.time)
                self._reply = None if is_lost(cycle) else reply
            self.time += CYCLE
            reference, _ = self.controller.references
            self.planned = self.planned if np.isnan(reference).any() else reference.copy()
            planned[cycle] = self.planned
            self._coming = self._report()
        return planned

    def _report(self) -> bytes | None:
        return self.controller.report(self.time, self.measured, self.planned, np.zeros(6))
