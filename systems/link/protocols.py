"""What a guided controller and a camera on a wire are, whoever made them, and their virtual counterparts.

A run knows these alone. A maker's folder has classes that fit them and a configuration that makes them, see
`systems.link.config`.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from systems.link.clock import ClockQuality
from systems.samples import PoseSample


class RobotReport(Protocol):
    """What a message of a controller says."""

    @property
    def seqno(self) -> int:
        """A number that grows by one with every message and begins anew after 2^32."""
        ...

    @property
    def time(self) -> float:
        """When the joints were read, s on the controller's clock."""
        ...

    @property
    def position(self) -> np.ndarray:
        """Measured joint positions (6,) in rad."""
        ...

    @property
    def is_ready(self) -> bool:
        """Whether the robot follows commands."""
        ...


class RobotLink(Protocol):
    """Any controller that reports its joints in a cycle and takes a command in reply to each report."""

    @property
    def arrived(self) -> float:
        """Steady time at which the newest report came, in s."""
        ...

    @property
    def place(self) -> str:
        """Where it is waited for, for messages: ``UDP 127.0.0.1:6510``."""
        ...

    @property
    def ports(self) -> tuple[int, int]:
        """Where reports and test signals come in; 0 for no signals."""
        ...

    @property
    def epoch(self) -> int:
        """Grows whenever commands must start anew from the measured position."""
        ...

    @property
    def velocity(self) -> np.ndarray:
        """Joint speeds (6,) in rad/s at the newest report, measured or from differences."""
        ...

    @property
    def effort(self) -> np.ndarray:
        """Torques (6,) in N m, joint side, at the newest report; zero if it does not report them."""
        ...

    @property
    def utilization(self) -> float:
        """How much of its performance the robot needs, 1 for all of it; 0 if that is not reported."""
        ...

    @property
    def heard(self) -> float:
        """Steady time at which anything last came from the controller, also what was refused, in s."""
        ...

    @property
    def heard_stamp(self) -> float:
        """What the controller's clock showed in that, in s."""
        ...

    @property
    def trouble(self) -> str:
        """Why its newest messages are refused, or why commands had to start anew, in words; else empty."""
        ...

    def why_not_ready(self) -> str:
        """What keeps the robot from following commands, in words."""
        ...

    def poll(self, timeout: float = 0.0) -> RobotReport | None:
        """The newest report that has come since the last call, waiting for at most ``timeout`` in s."""
        ...

    def poll_aside(self) -> None:
        """Takes in what comes beside the reports, such as test signals; never waits."""
        ...

    def send(self, position: np.ndarray, velocity: np.ndarray, is_speed_only: bool = False) -> bool:
        """Answers the newest report, once; False if it must not be, or has been, answered.

        Args:
            position: of the joints in rad, shape (6,).
            velocity: in rad/s, shape (6,).
            is_speed_only: whether the robot follows the velocity alone.
        """
        ...

    def stop(self, position: np.ndarray, velocity: np.ndarray, is_speed_only: bool = False) -> bool:
        """A command on the way to rest, the answer also to a report that was refused; arguments as of `send`.

        Returns:
            False if nothing has come that could be answered.
        """
        ...

    def warm_up(self) -> None:
        """Does the work of a report and a reply without any effect, so that the next ones find it warm."""
        ...

    def counters(self) -> dict[str, int]:
        """What has come and gone, by name; `replies` among them."""
        ...


class PoseSourceReport(Protocol):
    """What a camera's connection has to say, for logs and tables."""

    @property
    def last_error(self) -> str:
        """Why the last connection ended or did not come about."""
        ...

    @property
    def counters(self) -> dict[str, int]:
        """What became of packets and frames."""
        ...

    @property
    def clock(self) -> ClockQuality:
        """How well the clocks are known."""
        ...


class PoseSource(Protocol):
    """A camera system on a wire that says where the tool is."""

    def poll(self, now: float) -> PoseSample | None:
        """The newest sample that has not been given out before, its time on the clock of ``now`` (s)."""
        ...

    def report(self) -> PoseSourceReport:
        """The state of the connection as of now."""
        ...


class Starting(Protocol):
    """What needs time until it works."""

    @property
    def is_ready(self) -> bool:
        """Whether it works."""
        ...

    @property
    def problem(self) -> str:
        """Why it never will; empty as long as it may."""
        ...


class VirtualController(Protocol):
    """Stands for a maker's controller before a simulated robot. Times are its own clock's in s."""

    @property
    def references(self) -> tuple[np.ndarray, np.ndarray]:
        """Reference (6,) in rad and speed (6,) in rad/s; NaN for what is not given, both to stand still."""
        ...

    def receive(self, data: bytes, time: float, position: np.ndarray) -> bool:
        """Takes a datagram of a client; ``position`` is the planned one of the joints, (6,) in rad.

        Returns:
            Whether it is followed.
        """
        ...

    def cycle(self, time: float, planned: np.ndarray) -> None:
        """Moves the program on by one cycle."""
        ...

    def report(
        self, time: float, position: np.ndarray, planned: np.ndarray, torque: np.ndarray
    ) -> bytes | None:
        """The message of this cycle; None if it sends none."""
        ...

    def signals(
        self, time: float, position: np.ndarray, velocity: np.ndarray, torque: np.ndarray
    ) -> bytes | None:
        """The test signals of this cycle; None if it has none."""
        ...

    def stop(self, time: float, for_good: bool = False) -> None:
        """Ends guiding, as if somebody stopped the program."""
        ...

    def counters(self) -> dict[str, int]:
        """How often it restarted, and what became of the datagrams."""
        ...


class VirtualPoseSource(Protocol):
    """Stands for a maker's camera server."""

    def publish_body(self, time_us: int, number: int, X_WE: RigidTransform | None, residual: float) -> None:
        """Sends a frame to all clients; None for a body that is not seen.

        Args:
            time_us: stamp of the exposure on the camera's clock.
            number: of the frame.
            X_WE: the pose.
            residual: m, the camera's own estimate of its error.
        """
        ...


@dataclass(frozen=True)
class Wire:
    """Where to wait for a controller."""

    address: str  # of this machine
    port: int  # 0 for any free one
    controller: str  # its address; empty to take whoever speaks first
    break_after: float  # s of silence after which it counts as gone
    period: float  # s, its cycle
    signal_port: int | None = None  # of test signals, 0 for any free one; None for none


class Planner(Protocol):
    """What a controller puts between commands and drives: a system with both commands in and out."""

    def set_at_rest(self, context: Context, position: np.ndarray) -> None:
        """Stands still at joint positions (6,) in rad."""
        ...

    def planned_position(self, context: Context) -> np.ndarray:
        """The plan of the last tick in rad, shape (6,)."""
        ...
