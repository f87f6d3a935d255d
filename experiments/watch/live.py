"""People in a running cell: controller and cameras are heard and seen, and somebody else moves the robot."""

from array import array
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from pydrake.common.value import Value

from diagrams.hardware_link import EndedOnRequest, StationError
from diagrams.live_watch import Blind, people_at
from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario
from diagrams.watching import separation_monitor, watched_cell
from experiments.cli.console import count
from experiments.watch.run import Timeline, WatchRun, terms_at_full_speed, untrusted_note
from robots.description.model import RobotModel
from systems.guard.separation.separation_monitor import FAR, ZONES
from systems.link.clock import steady_time
from systems.link.protocols import RobotLink
from systems.samples import JointSample, PersonSample
from systems.vision.people.lasting_changes import LastingChange
from systems.vision.people.watch_process import WatchProcess

ADVICE = "nothing here slows or stops the robot: speed and stops are what would be allowed"
_LONGEST_START = 60.0  # s, that the process that looks may take until it sees
_AT_ONCE = 1e3  # 1/s
_COLUMNS = ("time", "distance", "protective_distance", "speed_share", "stop")


@dataclass(frozen=True)
class Decision:
    """What the robot would be allowed now."""

    time: float  # s, since the watch began
    distance: float  # m, of the nearest person; `FAR` where nobody is seen
    protective: float  # m
    share: float  # of the speed
    zone: str  # of `ZONES`
    age: float  # s, of the newest images that are trusted

    @property
    def text(self) -> str:
        """In words."""
        near = f"somebody at {self.distance:.2f} m" if self.distance < FAR else "nobody"
        near = near if self.distance > 0.0 else "somebody at the robot"
        old = f", images are {self.age:.1f} s old" if self.age < FAR else ", no image is trusted yet"
        return f"{self.time:.1f} s: {self.zone}, {near}, {100.0 * self.share:.0f} % of the speed{old}"


class Decisions:
    """The monitor beside a robot that somebody else moves, decision by decision."""

    def __init__(self, scenario: Scenario, robot: RobotModel) -> None:
        """Makes the monitor. Raises ValueError."""
        # What nothing has slowed or stopped need not speed up again, and nobody has to let it go on.
        limits = replace(scenario.servo.separation, acknowledge=False, rise=_AT_ONCE)
        scenario = replace(scenario, servo=replace(scenario.servo, separation=limits))
        self._monitor = separation_monitor(scenario, controller_model(scenario, robot).robot)
        self._context = self._monitor.CreateDefaultContext()
        self._rows = array("d")

    def decide(self, time: float, joints: JointSample, people: PersonSample) -> Decision:
        """The decision at a time in s, for a robot that moves as planned and has not been slowed."""
        for name, value in (
            ("person_sample", Value[object](people)),
            ("joint_sample", Value(joints)),
            ("velocity_command", joints.velocity),
            ("path_time", [time, 1.0]),
        ):
            self._monitor.GetInputPort(name).FixValue(self._context, value)
        self._context.SetTime(time)
        self._context.SetDiscreteState(self._monitor.EvalUniquePeriodicDiscreteUpdate(self._context))
        share, stop = (float(self._said(name)[0]) for name in ("speed_share", "stop"))
        distance, protective, zone, age = (float(value) for value in self._said("separation"))
        self._rows.extend([time, distance, protective, share, stop])
        return Decision(time, distance, protective, share, ZONES[round(zone)], age)

    def _said(self, name: str) -> np.ndarray:
        return self._monitor.GetOutputPort(name).Eval(self._context)

    def read(self) -> dict[str, np.ndarray]:
        """All decisions, by `_COLUMNS`."""
        rows = np.array(self._rows).reshape(-1, len(_COLUMNS))
        return dict(zip(_COLUMNS, rows.T, strict=True))


class LiveWatch:
    """Hears a controller, hands its joints to a process that looks for people, and says what it finds."""

    def __init__(
        self,
        scenario: Scenario,
        robot: RobotModel,
        client: RobotLink,
        tell: Callable[[Decision], None],
        is_over: Callable[[float], bool],
        now: Callable[[], float] = steady_time,
    ) -> None:
        """Takes over a connection that is open. Nothing is ever sent on it.

        Args:
            scenario: with `station.overview`.
            robot: that stands in the cell.
            client: to the controller.
            tell: is called with every decision.
            is_over: whether to end, given the time in s since the watch began.
            now: the clock of the client's arrivals, in s.

        Raises:
            ValueError: if a part refuses its configuration.
        """
        self._scenario, self._client, self._tell, self._is_over = scenario, client, tell, is_over
        self._cell = watched_cell(scenario, robot, Blind())
        self._decisions, self._now = Decisions(scenario, robot), now
        self._joints, self._notes = JointSample(), [ADVICE]
        self._is_silent = False
        self.problem = ""  # why the watch ended by itself

    def run(self, watch: WatchProcess, empty: int) -> WatchRun:
        """Watches until it is over.

        Args:
            watch: the process that looks; it has ended when this returns.
            empty: how many of its first sets of images show the empty cell.

        Raises:
            EndedOnRequest: if it is over before anybody looks.
            StationError: if the controller is not there, or nobody can look.
        """
        try:
            began = self._wait(watch, empty)
            self._watch(watch, began)
        finally:
            watch.end()
        seen, said = watch.seen, self._decisions.read()
        terms = terms_at_full_speed(self._scenario, self._cell)
        place = np.full((len(said["time"]), 2), np.nan)
        if seen is not None and len(seen.time):
            newest = np.searchsorted(seen.time - began, said["time"], side="right") - 1
            place[newest >= 0] = seen.place[newest[newest >= 0]]
        line = Timeline(
            said["time"],
            np.where(said["distance"] < FAR, said["distance"], np.nan),
            np.full(len(place), np.nan),
            said["protective_distance"],
            said["speed_share"],
            said["stop"] > 0.5,
            place,
        )
        if seen is None:
            return WatchRun(line, self._cell, None, terms, [*self._notes, "what was seen is lost"])
        notes = [*self._notes, f"{count(len(seen.time), 'set')} of images", *untrusted_note(seen)]
        nearest = seen.nearest and replace(seen.nearest, time=seen.nearest.time - began)
        changes = tuple(_since(began, each) for each in seen.changes)
        return WatchRun(line, self._cell, nearest, terms, notes, changes)

    def _wait(self, watch: WatchProcess, empty: int) -> float:
        """Hears the controller until people would be seen; the steady time then."""
        began, link = self._now(), self._scenario.station.link
        while watch.shared.sets < empty:
            waited = self._now() - began
            if self._is_over(0.0):
                raise EndedOnRequest
            if watch.problem:
                raise StationError(f"nobody looks for people: {watch.problem}")
            if not self._client.arrived and waited > link.connect:
                raise StationError(
                    f"no message of a controller came in: waited {link.connect:g} s on {self._client.place}"
                )
            if waited > max(_LONGEST_START, link.connect):
                raise StationError(f"no image of the empty cell within {waited:.0f} s")
            self._hear(watch, 0.02)
        watch.shared.begin_path(self._now())
        return self._now()

    def _watch(self, watch: WatchProcess, began: float) -> None:
        """Decides in the period of the monitor until it is over."""
        period, due = self._scenario.servo.separation.period, began
        while True:
            time = self._now() - began
            self._note_silence(time)
            self._tell(self._decisions.decide(time, self._joints, people_at(watch, time, began + time)))
            if watch.problem:
                self.problem = f"nobody looks for people any more at {time:.1f} s: {watch.problem}"
                self._notes.append(self.problem)
                return
            if self._is_over(time):
                return
            due = max(due + period, self._now())
            self._hear(watch, 0.0)  # also where decisions take longer than their period
            while (left := due - self._now()) > 0.0:
                self._hear(watch, left)

    def _hear(self, watch: WatchProcess, wait: float) -> None:
        report = self._client.poll(wait)
        if report is not None:
            watch.shared.note_joints(self._client.arrived, report.position)
            self._joints = JointSample(self._client.arrived, report.position, self._client.velocity)

    def _note_silence(self, time: float) -> None:
        """Once for each silence: without joints no image can be told from the robot, and the rest follows."""
        is_silent = self._now() - self._client.arrived > self._scenario.station.link.break_after
        if is_silent and not self._is_silent:
            self._notes.append(f"the controller fell silent at {time:.1f} s")
        self._is_silent = is_silent


def _since(began: float, change: LastingChange) -> LastingChange:
    """A change of the cell with times since the watch began at a steady time in s."""
    standing = replace(change.standing, since=change.standing.since - began)
    return replace(change, known=change.known - began, standing=standing)
