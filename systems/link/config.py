"""Where the controller and the camera of a real station are, and what a maker adds to it."""

from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from pydrake.systems.framework import LeafSystem

from robots.configuration.quantity import quantity
from robots.description.model import Placement, RobotModel
from systems.link.protocols import RobotLink, VirtualController, Wire
from systems.link.qualisys.maker import Qualisys
from systems.link.udp_channel import ipv4_address
from systems.reference.cartesian_path import CartesianPath


@dataclass
class LinkConfig:
    """Addresses, and what to do when the other end falls silent; a maker's class extends it."""

    kind: ClassVar[str]  # what scenarios and the command line call it
    title: ClassVar[str]  # what people call it
    takes_torque: ClassVar[bool] = False  # whether commands may have a torque feedforward

    address: str = "127.0.0.1"  # of this machine, to listen on for the controller
    port: int = quantity(6510, 0, 65535)  # where the controller sends its messages
    controller: str = ""  # its address; empty to take whoever speaks first
    connect: float = quantity(10.0, 0.1, 3600.0, "s")  # to wait for controller and camera
    # Silence after which the controller counts as gone
    break_after: float = quantity(0.1, 0.01, 10.0, "s")
    # With servo.guard.resume, a run goes on if the controller is back within this time; else it ends
    resume_within: float = quantity(10.0, 0.1, 3600.0, "s")
    signal_port: int = quantity(0, 0, 65535)  # of this machine, where test signals arrive; 0 for none
    # Whether there is a camera server to connect to; without one, no poses arrive
    has_camera: bool = True
    camera: Qualisys = field(default_factory=Qualisys)
    camera_frame: Placement = field(default_factory=Placement)  # of the camera system in the world
    tool_frame: Placement = field(default_factory=Placement)  # of the tool in the body that the camera tracks

    def wire(self, period: float, any_port: bool = False) -> Wire:
        """Where to wait for the controller, whose cycle is ``period`` in s; if wanted, on any free port.

        Raises:
            ChannelError: if the controller is named and has no address.
        """
        controller = ipv4_address("station.link.controller", self.controller) if self.controller else ""
        signal_port = (0 if any_port else self.signal_port) if self.signal_port else None
        return Wire(
            self.address, 0 if any_port else self.port, controller, self.break_after, period, signal_port
        )

    def check(self) -> None:
        """Refuses settings that contradict each other. Raises ValueError."""

    def open(self, robot: RobotModel, wire: Wire) -> AbstractContextManager[RobotLink]:
        """The client's end of the wire, for as long as a block lasts. Raises ValueError if it cannot be."""
        raise NotImplementedError

    def planner(self, period: float, takes_position: bool) -> LeafSystem:
        """What plans between commands and drives, as the controller does; a `systems.link.protocols.Planner`.

        Args:
            period: s, its cycle.
            takes_position: False where it follows speeds alone.
        """
        raise NotImplementedError

    def virtual_controller(
        self, robot: RobotModel, path: CartesianPath | None = None, home: np.ndarray | None = None
    ) -> VirtualController:
        """The controller's end of the wire, before a simulated robot.

        Args:
            robot: as the controller knows it.
            path: that a program of its own runs, if it has one.
            home: joint positions (6,) in rad near which the path begins.
        """
        raise NotImplementedError
