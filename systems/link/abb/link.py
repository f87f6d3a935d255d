"""Externally Guided Motion of ABB: what a scenario says of it, and the parts that a station takes from it."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

import numpy as np

from robots.description.model import RobotModel
from systems.link.abb.client import EgmClient
from systems.link.abb.controller import EgmRunConfig, VirtualController
from systems.link.abb.motion import EgmMotion, EgmMotionConfig
from systems.link.abb.path_program import PathProgram
from systems.link.abb.robot_link import AbbRobotLink
from systems.link.abb.signal_client import SignalClient
from systems.link.abb.signals import SignalCodec, SignalLayout
from systems.link.protocols import Wire
from systems.reference.cartesian_path import CartesianPath


@dataclass
class EgmSettings:
    """Of the controller and of its test signals; with `systems.link.config.LinkConfig` it is a link."""

    motion: EgmMotionConfig = field(default_factory=EgmMotionConfig)
    run: EgmRunConfig = field(default_factory=EgmRunConfig)
    signals: SignalLayout = field(default_factory=SignalLayout)

    def check(self) -> None:
        """Refuses a layout of test signals and a program that cannot be. Raises ValueError."""
        SignalCodec(self.signals)
        if self.run.streams and self.run.path_correction:
            raise ValueError("a program that streams takes no corrections: run.path_correction must be false")

    def planner(self, period: float, takes_position: bool) -> EgmMotion:
        """What plans between commands and drives, as the controller does."""
        return EgmMotion(self.motion, period, takes_position=takes_position)

    def virtual_controller(
        self, robot: RobotModel, path: CartesianPath | None = None, home: np.ndarray | None = None
    ) -> VirtualController:
        """The controller's end of the wire, before a simulated robot.

        Args:
            robot: as the controller knows it.
            path: that its program runs where `EgmRunConfig.path_correction` or ``streams`` says so.
            home: joint positions (6,) in rad near which the path begins.
        """
        program = None
        has_program = self.run.path_correction or self.run.streams
        if has_program and path is not None and home is not None:
            program = PathProgram(robot, path, home, self.run.correction_lag)
        return VirtualController(robot, self.run, self.signals, program)

    @contextmanager
    def open(self, robot: RobotModel, wire: Wire) -> Iterator[AbbRobotLink]:
        """The client's end of the wire, for as long as the block lasts.

        Raises:
            ChannelError: if it cannot listen there.
            ValueError: if a part refuses its configuration.
        """
        with ExitStack() as stack:
            host = wire.controller or None
            client = stack.enter_context(
                EgmClient(robot.speed, wire.port, wire.address, host, wire.break_after, period=wire.period)
            )
            listener = None
            if wire.signal_port is not None:
                listener = stack.enter_context(
                    SignalClient(self.signals, wire.signal_port, wire.address, host)
                )
            yield AbbRobotLink(client, listener)
