"""Runs a virtual cell in real time behind the sockets of a controller and a camera."""

import heapq
import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from diagrams.runs.undisturbed import undisturbed
from diagrams.runs.virtual_cell import Exposure, VirtualCell
from diagrams.scenario.scenario import Scenario
from robots.description.model import RobotModel
from systems.cell.network_faults import FaultyLink
from systems.link.clock import steady_time
from systems.link.protocols import VirtualPoseSource
from systems.link.udp_channel import Address, Buffering, UdpChannel, is_loopback
from systems.reference.paths import make_path

_LATE = 1e-3  # s after which a message counts as late
_LOST_TRACK = 0.25  # s behind after which the schedule is moved instead of being caught up with
_FORGOTTEN = 2.0  # s of silence after which another client may command
_SPIN = 1.5e-4  # s before an instant in which the loop does not sleep: a system wakes late by that much


@dataclass
class CellStatistics:
    """Timing and message counts of a cell."""

    cycles: int = 0
    late: int = 0  # messages of the robot that left more than a millisecond late
    worst_lateness: float = 0.0  # s
    # Stamps in s of the messages that left less than half a cycle after the one before, to catch up.
    crowded_at: list[float] = field(default_factory=list)
    schedule_moves: int = 0  # times at which the machine was gone for so long that the schedule moved
    commands: int = 0  # datagrams that came in
    strangers: int = 0  # datagrams of others than the one client that is obeyed
    camera_frames: int = 0
    controller: dict[str, int] = field(default_factory=dict)
    faults: dict[str, dict[str, int]] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """For a JSON text."""
        return dict(vars(self))


class CellLoop:
    """Sends the messages of the cell when they are due, and receives commands at the start of every cycle."""

    def __init__(
        self,
        scenario: Scenario,
        robot: RobotModel,
        target: Address,
        camera: VirtualPoseSource | None = None,
        signal_target: Address | None = None,
        address: str = "127.0.0.1",
        with_log: bool = True,
        peer: str = "",
        tell: Callable[[str], None] = lambda text: None,
        note_joints: Callable[[float, np.ndarray], None] | None = None,
    ) -> None:
        """Builds the cell and opens its sockets.

        Args:
            scenario: whose station this is, with the faults.
            robot: the nominal one.
            target: where the robot's messages go.
            camera: to whom the exposures go.
            signal_target: where test signals go; None for none.
            address: of the interface that commands are heard on.
            with_log: whether the truth will be asked for.
            peer: address of the only machine that is obeyed; empty for the first that sends a command.
            tell: is called with who is obeyed, in words.
            note_joints: is told in every cycle the steady time in s and the joint positions (6,) in rad.

        Raises:
            ValueError: if a part refuses its configuration or the address cannot be used.
        """
        if is_loopback(target[0]) != is_loopback(address):
            raise ValueError(
                f"the cell would send its messages to {target[0]} and hear commands on {address}: "
                "one of them is on this machine alone"
            )
        config = scenario.station
        self._faults = config.faults
        self.cell = VirtualCell(scenario, robot, with_log)
        path, home = make_path(scenario.reference), np.deg2rad(scenario.home_deg)
        self.controller = config.link.virtual_controller(robot, path, home)
        self.statistics = CellStatistics()
        self._links = {
            name: FaultyLink(config.faults, period, scenario.seed + offset)
            for offset, (name, period) in enumerate(
                (
                    ("to client", config.period),
                    ("from client", config.period),
                    ("camera", config.camera.period),
                )
            )
        }
        self._target, self._signal_target, self._camera = target, signal_target, camera
        self._channel = UdpChannel(0, address, Buffering.NEWEST)
        self._stranger = UdpChannel(0, address)
        self._peer, self._tell, self._note_joints = peer, tell, note_joints
        self._obeyed: Address | None = None
        self._obeyed_at = 0.0  # s of the cell's time, when the last command of it came
        self._order = itertools.count()
        self._outbox: list[tuple[float, int, Callable[[], None]]] = []
        self._inbox: list[tuple[float, int, bytes, Address]] = []
        self._is_stopped = False
        self._frame = 0

    @undisturbed()
    def run(self, until: Callable[[float], bool]) -> CellStatistics:
        """Runs in real time until ``until``, which is given the cell's time in s every cycle, says so."""
        self._run(until)
        for name, link in self._links.items():
            self.statistics.faults[name] = dict(link.counts)
        self.statistics.controller = self.controller.counters()
        return self.statistics

    def close(self) -> None:
        """Closes the sockets."""
        self._channel.close()
        self._stranger.close()

    def _run(self, until: Callable[[float], bool]) -> None:
        cell, statistics = self.cell, self.statistics
        start = steady_time() - cell.time
        began = start
        self._post_report()
        while not until(cell.time):
            now = cell.time
            self._hand_out(start, now - 1e-6)
            _wait_until(start + now)
            # A controller hears before it speaks: a reply to this cycle's message belongs to the next one.
            self._hear(now)
            self._hand_out(start, now)
            before, began = began, steady_time()
            if began - before < 0.5 * cell.period:
                statistics.crowded_at.append(cell.stamp)
            lateness = began - start - now
            if lateness > _LOST_TRACK:
                start += lateness
                statistics.schedule_moves += 1
            statistics.cycles += 1
            statistics.late += lateness > _LATE
            statistics.worst_lateness = max(statistics.worst_lateness, lateness)
            if 0.0 <= self._faults.stop_at <= now and not self._is_stopped:
                self._is_stopped = True
                self.controller.stop(cell.stamp)
            self.controller.cycle(cell.stamp, cell.planned)
            exposures = cell.advance(self.controller)
            self._post_report()
            for exposure in exposures:
                self._post_exposure(exposure)

    def _hand_out(self, start: float, until: float) -> None:
        """Sends everything that is due until an instant of the cell's time, each thing at its time."""
        while self._outbox and self._outbox[0][0] <= until + 1e-9:
            due, _, send = heapq.heappop(self._outbox)
            _wait_until(start + due)
            send()

    def _hear(self, now: float) -> None:
        for data, sender in self._channel.receive():
            self.statistics.commands += 1
            if not self._may_command(sender, now):
                self.statistics.strangers += 1
                continue
            for delivery in self._links["from client"].pass_on(now, data):
                if not delivery.is_foreign:
                    heapq.heappush(self._inbox, (delivery.time, next(self._order), delivery.data, sender))
        while self._inbox and self._inbox[0][0] <= now:
            _, _, data, sender = heapq.heappop(self._inbox)
            if self.controller.receive(data, self.cell.stamp, self.cell.planned):
                if self._obeyed != sender:
                    self._tell(f"obeys {sender[0]}:{sender[1]}")
                self._obeyed, self._obeyed_at = sender, now

    def _may_command(self, sender: Address, now: float) -> bool:
        """Whether it is the one client that is obeyed, or may become it: after a silence another one may."""
        if self._peer and sender[0] != self._peer:
            return False
        return self._obeyed in (None, sender) or now - self._obeyed_at > _FORGOTTEN

    def _post(self, due: float, send: Callable[[], Any]) -> None:
        heapq.heappush(self._outbox, (due, next(self._order), send))

    def _post_report(self) -> None:
        """Puts the robot's message of the cell's time on its way."""
        now, joints = self.cell.time, self.cell.joints
        stamp = self.cell.stamp
        if self._note_joints is not None:
            self._note_joints(steady_time(), joints.position)
        report = self.controller.report(stamp, joints.position, self.cell.planned, joints.effort)
        for delivery in self._links["to client"].pass_on(now, report) if report is not None else ():
            channel = self._stranger if delivery.is_foreign else self._channel
            self._post(
                delivery.time,
                lambda data=delivery.data, channel=channel: channel.send(data, self._target),
            )
        if self._signal_target is not None:
            target = self._signal_target
            data = self.controller.signals(stamp, joints.position, joints.velocity, joints.effort)
            if data is not None:
                self._post(now, lambda data=data: self._channel.send(data, target))

    def _post_exposure(self, exposure: Exposure) -> None:
        camera, sample = self._camera, exposure.sample
        if camera is None or not np.isfinite(sample.time):
            return
        self._frame += 1
        is_seen = sample.valid and not self._faults.is_body_lost(sample.time)
        X_WE = sample.X_WE if is_seen else None
        # The camera has a clock of its own, which began elsewhere and may be faster.
        stamp = round(1e6 * sample.time * (1.0 + 1e-6 * self._faults.clock_drift_ppm)) + 5_000_000
        number = self._frame

        def publish() -> None:
            self.statistics.camera_frames += 1
            camera.publish_body(stamp, number, X_WE, sample.residual)

        for delivery in self._links["camera"].pass_on(exposure.published, b""):
            if not delivery.is_foreign and delivery.data == b"":
                self._post(delivery.time, publish)


def _wait_until(instant: float) -> None:
    """Sleeps, and at the end only looks at the clock."""
    left = instant - steady_time()
    if left > _SPIN:
        time.sleep(left - _SPIN)
    while steady_time() < instant:
        pass
