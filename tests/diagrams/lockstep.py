"""A virtual cell and its client in one process, message by message instead of second by second.

The bytes are those of the wire and the cell is the one of ``truetip cell``; only the clock is not a real one,
so that a run is the same every time and takes as long as it has to.
"""

import heapq
import itertools
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from diagrams.runs.virtual_cell import VirtualCell
from diagrams.scenario.scenario import Scenario
from robots.description.model import load_robot
from systems.cell.network_faults import FaultyLink
from systems.link.abb.messages import Command, Mode, RobotReport
from systems.link.abb.robot_link import AbbRobotLink
from systems.link.abb.session import EgmSession
from systems.link.clock import ClockQuality
from systems.link.protocols import RobotLink
from systems.link.session import TelegramError
from systems.reference.paths import make_path
from systems.samples import PoseSample

LOOK = 2e-5  # s that it takes to look for a message
TURN_AROUND = 4e-4  # s, of the client: its reply is heard at the next cycle
CELL, STRANGER = ("127.0.0.1", 40000), ("127.0.0.1", 40001)


class Lockstep:
    """The client's and the camera's end of a wire, with the cell behind it."""

    def __init__(self, scenario: Scenario) -> None:
        robot, config = load_robot(scenario.robot), scenario.station
        self.cell = VirtualCell(scenario, robot)
        path, home = make_path(scenario.reference), np.deg2rad(scenario.home_deg)
        self.controller: Any = config.link.virtual_controller(robot, path, home)  # of any maker
        self.session = self.new_session(scenario)
        self.channel = SimpleNamespace(address=("127.0.0.1", 6510))
        self.time = self.arrived = 0.0
        self.faults = config.faults
        self.to_client = FaultyLink(config.faults, config.period, 1)
        self.from_client = FaultyLink(config.faults, config.period, 2)
        self._order = itertools.count()
        self._on_the_way: list = []  # (time, order, data, sender) to the client
        self._replies: list = []  # (time, order, data) to the controller
        self.sent: list[tuple[float, bytes]] = []  # time and bytes of every command
        self.stamps: list[float] = []  # s, of the messages that they answer
        self.measured: list[np.ndarray] = []  # (6,) rad, joints in those
        self._heard_stamp = 0.0  # s, of the newest message
        # When the cell stands still (s of its own time), for how long, and whether it then catches up in a
        # burst; otherwise it stays behind, as its clock does that stood still too.
        self.halts: list[tuple[float, float, bool]] = []
        self._frames: list[tuple[float, PoseSample]] = []
        self._is_stopped = False
        self._report()

    def new_session(self, scenario: Scenario) -> Any:
        """Of the maker whose robot it is."""
        config = scenario.station
        speed = load_robot(scenario.robot).speed
        return EgmSession(speed, config.link.break_after, period=config.period)

    def now(self) -> float:
        """The one clock of client and cell in s."""
        return self.time

    def poll(self, timeout: float = 0.0) -> RobotReport | None:
        """As `systems.link.abb.client.EgmClient.poll`; time passes only here."""
        self.session.forget_trouble()
        end = self.time + max(timeout, LOOK)
        while not self._on_the_way or self._on_the_way[0][0] > end:
            if self._wall_time > end:
                self.time = end
                self.session.check(end)
                return None
            self._cycle()
        newest = None
        self.time = max(self.time, self._on_the_way[0][0])
        while self._on_the_way and self._on_the_way[0][0] <= self.time:
            _, _, data, sender = heapq.heappop(self._on_the_way)
            report = self.session.receive(data, sender, self.time)
            if sender == CELL:
                with suppress(TelegramError):
                    self._heard_stamp = self.session.codec.decode(data).time
            if report is not None:
                newest, self.arrived = report, self.time
        return newest

    def answer(self, command: Any) -> bool:
        """As `systems.link.client.LinkClient.answer`."""
        last = self.session.last
        return self._put_on_the_way(self.session.answer(command, self.time), last.time if last else 0.0)

    def answer_stopping(self, command: Any) -> bool:
        """As `systems.link.client.LinkClient.answer_stopping`."""
        return self._put_on_the_way(self.session.answer_stopping(command, self.time), self._heard_stamp)

    def reply(self, mode: Mode, command: Command) -> bool:
        """As `systems.link.abb.client.EgmClient.reply`."""
        return self.answer((mode, command))

    def _put_on_the_way(self, data: bytes | None, stamp: float) -> bool:
        if data is None:
            return False
        self.sent.append((self.time, data))
        self.stamps.append(stamp)
        last = self.session.last
        self.measured.append(last.position if last else np.full(6, np.nan))
        for delivery in self.from_client.pass_on(self.time + TURN_AROUND, data):
            if not delivery.is_foreign:
                heapq.heappush(self._replies, (delivery.time, next(self._order), delivery.data))
        return True

    def stop(self, mode: Mode, command: Command) -> bool:
        """As `systems.link.abb.client.EgmClient.stop`."""
        return self.answer_stopping((mode, command))

    def warm_up(self) -> None:
        """As `systems.link.abb.client.EgmClient.warm_up`."""
        self.session.warm_up()

    def switch_motors_off(self) -> None:
        """Somebody presses the button before the first message is out."""
        self.controller.motors_on = False
        self._on_the_way.clear()
        self._report()

    def run_dry(self, cycles: int) -> None:
        """Goes on without a client."""
        for _ in range(cycles):
            self._cycle()

    @property
    def link(self) -> RobotLink:
        """The client's end as a run takes it."""
        return AbbRobotLink(self)  # pyright: ignore[reportArgumentType]

    def camera(self) -> "LockstepCamera":
        """The camera's end of the wire."""
        return LockstepCamera(self)

    def frames_until(self, time: float) -> list[tuple[float, PoseSample]]:
        """What the camera has published; each once."""
        known = [frame for frame in self._frames if frame[0] <= time]
        self._frames = self._frames[len(known) :]
        return known

    @property
    def _wall_time(self) -> float:
        """When the cell's present cycle begins, in s."""
        time = self.cell.time
        for at, seconds, catches_up in self.halts:
            if self.cell.time >= at:
                time = max(time, at + seconds) if catches_up else time + seconds
        return time

    def _cycle(self) -> None:
        now = self._wall_time
        while self._replies and self._replies[0][0] <= now:
            data = heapq.heappop(self._replies)[2]
            self.controller.receive(data, self.cell.stamp, self.cell.planned)
        if 0.0 <= self.faults.stop_at <= self.cell.time and not self._is_stopped:
            self._is_stopped = True
            self.controller.stop(self.cell.stamp)
        self.controller.cycle(self.cell.stamp, self.cell.planned)
        exposures = self.cell.advance(self.controller)
        behind = self._wall_time - self.cell.time
        self._frames += [
            (published + behind, replace(sample, time=sample.time + behind))
            for published, sample in exposures
        ]
        self._report()

    def _report(self) -> None:
        joints = self.cell.joints
        data = self.controller.report(self.cell.stamp, joints.position, self.cell.planned, joints.effort)
        for delivery in self.to_client.pass_on(self._wall_time, data) if data is not None else ():
            sender = STRANGER if delivery.is_foreign else CELL
            heapq.heappush(self._on_the_way, (delivery.time, next(self._order), delivery.data, sender))


class LockstepCamera:
    """As `systems.link.qualisys.receiver.MocapReceiver`, with a clock that is known."""

    def __init__(self, wire: Lockstep) -> None:
        self._wire = wire

    def poll(self, now: float) -> PoseSample | None:
        """The newest sample, if there is a new one."""
        frames = self._wire.frames_until(now)
        return frames[-1][1] if frames else None

    def report(self) -> Any:
        """What the run asks for at its end."""
        clock = ClockQuality(0, 0.0, 0.0, 0.0, 0.0, {}, 1)
        return SimpleNamespace(counters={}, clock=clock, last_error="")
