"""A servo and a real station: the controller's message is the clock, one in, one tick, one out."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System

from diagrams.hardware import HardwareStation
from diagrams.hardware_link import EndedOnRequest, HardwareLink, StationError, never
from diagrams.live_watch import OF_WATCH, LivePeople, LiveWatch, StopEvents, live_watch, people_at
from diagrams.record.log import GuardEvent, RunLog
from diagrams.record.played import measured_along, path_marks, played
from diagrams.record.run_record import RunRecord, marks, write_event
from diagrams.record.spool import Spool, SpooledLog
from diagrams.runs.real_time_record import RealTimeRecord, fill_gaps, write_run_tick
from diagrams.runs.simulation import guard_events
from diagrams.runs.standstill import Standstill
from diagrams.runs.start import start_position
from diagrams.runs.tick_ahead import TickAhead
from diagrams.runs.undisturbed import undisturbed
from diagrams.scenario.scenario import Scenario, ScenarioError
from diagrams.servo import Servo, calibrated, hear, law_name, learn, learnt
from diagrams.tool_watch import ToolWatch
from robots.description.model import NUM_JOINTS, RobotModel, load_robot
from systems.guard.guard import KINDS
from systems.guard.performance_share import PerformanceShare
from systems.link.clock import steady_time
from systems.link.protocols import PoseSource, RobotLink, RobotReport
from systems.reference.paths import CartesianPath
from systems.samples import JointSample, PoseSample
from systems.vision.people.watch_process import WatchProcess

__all__ = ["REQUESTED", "RealTimeRecord", "RealTimeRun", "StationError"]

_WARM_UP = 60  # ticks
REQUESTED = "ended on request"  # why a run ended that somebody wanted to end
_STOOD = 0.5  # s at rest by the guard, after which a run is over that nothing leads back


class RealTimeRun:
    """One law on a real station, from a smooth approach to the end of the dwell."""

    def __init__(
        self,
        scenario: Scenario,
        law: str | type[System] | System,
        robot: RobotModel | None = None,
        watch: LiveWatch | None = None,
    ) -> None:
        """Builds the servo and warms it up, before anything is said to a robot.

        Args:
            scenario: what to do; its ``station.link`` says where the station is.
            law: a shipped law by name, ``FILE.py:CLASS``, a class, or any system with the ports of a law.
            robot: as the controller knows it; None for the scenario's.
            watch: what watches for people; None for what the scenario says.

        Raises:
            ScenarioError: if the robot cannot follow the path.
            ValueError: if a part refuses its configuration.
        """
        self.scenario, self.law = scenario, law_name(law)
        self.robot = robot or load_robot(scenario.robot)
        self.period = scenario.station.period
        if scenario.servo.feedforward.kind != "none":
            raise ScenarioError("servo.feedforward.kind must be none on a real station: it takes no torques")
        builder = DiagramBuilder()
        self._live = watch or live_watch(scenario, self.robot)
        self._watch: WatchProcess | None = None  # while it runs
        self.servo = builder.AddNamedSystem("servo", Servo(self.robot, scenario, law, self._live))
        station = HardwareStation(self._live is not None, self.servo.obeys_controller)
        self.station = builder.AddNamedSystem("station", station)
        self.servo.tick_clock.stop()  # what is timed is how long an answer takes
        self._is_speed_only = self.servo.drive == "velocity"
        for name in ("position_command", "velocity_command"):
            builder.Connect(self.servo.GetOutputPort(name), self.station.GetInputPort(name))
        for name in (
            "joint_sample",
            "pose_sample",
            *(("person_sample", "acknowledge") if self._live else ()),
        ):
            builder.Connect(self.station.GetOutputPort(name), self.servo.GetInputPort(name))
        if self.servo.obeys_controller:
            port = self.servo.GetInputPort("speed_share_controller")
            builder.Connect(self.station.GetOutputPort("speed_share"), port)
        ports = ["position_command", "velocity_command", "correction", "guard_status"]
        if self.servo.reference.is_slowed:
            ports.append("path_time")
        ports += OF_WATCH if self._live else ()
        self._log = SpooledLog({name: self.servo.GetOutputPort(name) for name in ports})
        self.diagram: Diagram = builder.Build()
        self.diagram.set_name("truetip")
        self.path: CartesianPath = self.servo.reference.path
        self.start = start_position(self.servo.model, scenario, self.path)
        self._warm_up()
        self._context: Context = self.diagram.CreateDefaultContext()
        self._ahead = TickAhead(self.diagram, self.station)
        self._joints = JointSample()  # of the newest tick
        self._next, self._last_exposure = 0, -math.inf  # tick that the context stands before; s of the path
        self._reports = Spool(2 + 2 * NUM_JOINTS)  # tick, stamp in s, positions in rad, efforts in N m
        self._exposures = Spool(17)  # s of the path, and the pose
        self._tool = ToolWatch(self.servo.model.robot)
        self._pauses: list[tuple[float, float]] = []
        self._events: list[GuardEvent] = []
        self._stream: RunRecord | None = None
        self._is_acknowledged: Callable[[], bool] = never
        self._standstill = Standstill(self.servo)
        self._stops = StopEvents()
        self._performance = PerformanceShare() if self.servo.obeys_controller else None

    @property
    def uses_camera(self) -> bool:
        """Whether the law stops where the camera sees nothing."""
        return self.servo.traits.uses_camera

    @property
    def begins_with_camera(self) -> bool:
        """Whether the run does not begin before the camera sees the tool."""
        return self.uses_camera or self.servo.traits.learns_from_camera

    @undisturbed()
    def run(
        self,
        client: RobotLink,
        camera: PoseSource | None,
        progress: Callable[[float], None] | None = None,
        now: Callable[[], float] = steady_time,
        is_asked_to_end: Callable[[], bool] = never,
        record: RunRecord | None = None,
        is_acknowledged: Callable[[], bool] = never,
    ) -> RealTimeRecord:
        """Runs the law on the station at the other end.

        However it ends before its end, also by an error of a law or Ctrl-C, the robot is sent a smooth stop
        as long as its controller speaks.

        Args:
            client: to the controller.
            camera: to the camera server; None for laws that do without.
            progress: is called now and then with the share that is done, 0 to 1.
            now: the clock of the client's arrivals, in s.
            is_asked_to_end: whether somebody wants the run to end now.
            record: to which the run is logged while it goes on; it is closed at the end, however that is.
            is_acknowledged: whether somebody now lets the robot go on that was stopped for people.

        Raises:
            StationError: if there is no controller or camera, or its cycle is not the scenario's.
        """
        self._stream, self._is_acknowledged = record, is_acknowledged
        before = client.counters()
        watch = self._watch = self._live.start() if self._live else None
        try:
            wire = HardwareLink(
                client,
                camera,
                self.scenario,
                self.robot,
                self._is_speed_only,
                now,
                is_asked_to_end,
                watch.shared.note_joints if watch else None,
            )
            try:
                wire.connect(self.begins_with_camera)
                seen, guard = wire.poses.newest, self.scenario.servo.guard
                if why := self._tool.contradiction(wire.last, seen, guard):
                    raise StationError(why)
                if watch:
                    wire.wait_for(watch, "nobody looks for people")
                wire.approach(self.start)
                began = now()
                ended = self._follow(wire, progress or (lambda share: None), now, is_asked_to_end)
            except EndedOnRequest:
                began, ended = now(), REQUESTED
            except BaseException as error:
                wire.stop_smoothly()
                if len(self._reports):
                    self._record({}, camera, wire, f"{type(error).__name__}: {error}")
                raise
            if ended != "path":
                wire.stop_smoothly()
                if ended != REQUESTED:
                    ended += wire.host.reason(began)
        finally:
            if watch:
                watch.end()
            if record is not None and not len(self._reports):
                record.close(law=self.law, ended="before its path")
        counters = {name: number - before[name] for name, number in client.counters().items()}
        return self._record(counters, camera, wire, ended)

    def _follow(
        self,
        wire: HardwareLink,
        progress: Callable[[float], None],
        now: Callable[[], float],
        is_asked_to_end: Callable[[], bool],
    ) -> str:
        """Runs the path to its end; returns why it ended."""
        epoch, tick, shown, prepare = wire.epoch, -1, 0.0, partial(self._prepare, wire)
        wire.start_path()
        if self._watch:
            self._watch.shared.begin_path(now())
        while self.servo.path_time(self._context) < self.path.duration + 0.5 * self.period:
            if is_asked_to_end():
                return REQUESTED
            report = wire.next_report(prepare=prepare)
            is_seeding = False
            if report is None or not report.is_ready or wire.epoch != epoch:
                # One that is ready came after a silence that nobody noticed while this process was held up.
                has_stopped = report is not None and not report.is_ready
                why = wire.trouble or f"the controller {'stopped' if has_stopped else 'fell silent'}"
                if not self.scenario.servo.guard.resume:
                    return why
                self._note(max(tick, 0), "interrupted", why)
                wire.stop_smoothly()
                began = now()
                report = wire.wait_until_ready(self.scenario.station.link.resume_within)
                if report is None:
                    return REQUESTED if is_asked_to_end() else "the controller did not come back"
                self._pauses.append((tick * self.period, now() - began))
                epoch, is_seeding = wire.epoch, True
            elif tick >= 0 and wire.was_interrupted:
                # Shorter than a break, but the robot may have come to rest: it is led on from where it is.
                self._note(tick, "interrupted", f"no message for {1e3 * wire.gap:.0f} ms")
                is_seeding = True
            if is_seeding:
                wire.start_path()
                tick += 1
            else:
                tick += wire.ticks_since_last() if tick >= 0 else 1  # the first one is its tick 0
            if wire.clock_step:
                self._note(tick, "clock_step", f"the controller's clock went {wire.clock_step:.3g} s ahead")
                wire.start_path()
            self._tick(wire, report, tick, is_running=not is_seeding)
            if wire.following.problem:
                return wire.following.problem
            # Telling people takes time that belongs to the next message.
            if tick * self.period - shown > 0.5:
                shown = tick * self.period
                progress(min(1.0, self.servo.path_time(self._context) / self.path.duration))
                if self._watch and self._watch.problem:
                    return f"nobody looks for people any more: {self._watch.problem}"
            stood = self._standstill.lasts(self._context, tick * self.period, self._last_exposure)
            if stood > _STOOD and not self.scenario.servo.guard.resume:
                break
        return self._standstill.reason(self._context) if self._standstill.since is not None else "path"

    def _note(self, tick: int, kind: str, detail: str) -> None:
        self._events.append(GuardEvent(tick * self.period, kind, detail))
        if self._stream is not None:
            write_event(self._stream, self._events[-1])

    def _tick(self, wire: HardwareLink, report: RobotReport, tick: int, is_running: bool) -> None:
        """One message in, one tick, one reply out."""
        for _ in range(self._next, tick):  # those whose message did not come
            self._update(self._context)
            self._stand_before_next()
        time = tick * self.period
        sample = wire.pose_at(time)
        joints = JointSample(time, report.position, wire.velocity, wire.effort, is_running)
        is_usual = is_running and math.isfinite(sum(report.position.tolist()))
        known = self._ahead.command(time, sample) if is_usual else None
        if known is not None:
            sent = wire.send_command(*known)
            self._context = self._ahead.take_over(self._context)
        self._joints = joints
        self.station.receive(self._context, joints, sample, people_at(self._watch, time, wire.arrived))
        is_acknowledged = self._watch is not None and self._is_acknowledged()
        if self._watch:
            self.station.acknowledge(self._context, is_acknowledged)
        if self._performance:
            rate = self.servo.path_rate(self._context)
            self.station.slow(self._context, self._performance.after(wire.utilization, rate, wire.passed))
        if not len(self._reports):
            self._note_ports()  # here, where the log finds samples to begin with
        if known is None:
            self._update(self._context)
            sent = wire.send_command(*self.station.command(self._context))
        if self._stream is not None:
            write_run_tick(
                self._stream, self.servo, self._context, time, report, wire.effort, sent,
                sample if sample.time > self._last_exposure else PoseSample(),
            )  # fmt: skip
        events = self._stops.note(self.servo, self._context, is_acknowledged) if self._watch else []
        found = self._tool.note(time, report.position, sample)
        for event in (*events, *([found] if found else [])):
            self._note(tick, *event)
        self._stand_before_next()
        # Nobody waits for the rest; it is last, because what stands at the ports was known before.
        if known is not None:
            hear(self.servo, self._context)
        learn(self.servo, self._context)
        self._reports.append(tick, report.time, report.position, wire.effort)
        if sample.valid and sample.time > self._last_exposure:
            self._last_exposure = sample.time
            self._exposures.append(sample.time, sample.X_WE.GetAsMatrix4().ravel())

    def _update(self, context: Context) -> None:
        """Everything that the servo does at a tick."""
        context.SetDiscreteState(self.diagram.EvalUniquePeriodicDiscreteUpdate(context))

    def _stand_before_next(self) -> None:
        """Nothing happens between two ticks, so the time of the next one may begin right after the reply."""
        self._next += 1
        self._context.SetTime(self._next * self.period)
        self._note_ports()  # what stands before the tick, as a simulation logs it

    def _note_ports(self) -> None:
        self._log.note(self.servo.GetMyContextFromRoot(self._context))

    def _warm_up(self) -> None:
        """Computes ticks on a context that is thrown away, so that the first reply is no slower."""
        context = self.diagram.CreateDefaultContext()
        X_WE = self.servo.reference.GetOutputPort("X_WE_desired").Eval(
            self.servo.reference.GetMyContextFromRoot(context)
        )
        zero = np.zeros(NUM_JOINTS)
        for tick in range(_WARM_UP):
            time = tick * self.period
            context.SetTime(time)
            self.station.receive(
                context, JointSample(time, self.start, zero, zero, True), PoseSample(time, X_WE, True)
            )
            self._update(context)
            self.station.command(context)
            self._log.values(self.servo.GetMyContextFromRoot(context))

    def _prepare(self, wire: HardwareLink) -> None:
        """Does before the message comes what can be done: all of the tick, if the law needs no joints."""
        last, sample = self._joints, wire.poses.coming
        is_asked = self._live or self._performance  # for a share of the speed, at every tick
        is_free = last.running and not (is_asked or self.servo.traits.awaits_joints)
        if is_free and sample is not None:
            self._ahead.work_out(self._context, last, sample)
        else:
            self._ahead.rehearse(self._context)

    def _record(
        self, counters: dict[str, int], camera: PoseSource | None, wire: HardwareLink, ended: str
    ) -> RealTimeRecord:
        times, data = self._log.read()
        path = played(self.path, times, data)
        n = len(times)
        positions, efforts = np.full((n, NUM_JOINTS), np.nan), np.full((n, NUM_JOINTS), np.nan)
        stamps = np.full(n, np.nan)
        ticks = np.round(times / self.period).astype(int)
        row_of = {int(tick): row for row, tick in enumerate(ticks)}
        for tick, stamp, *joints in self._reports.read():
            row = row_of.get(int(tick))
            if row is not None:
                stamps[row], positions[row], efforts[row] = stamp, joints[:NUM_JOINTS], joints[NUM_JOINTS:]
        fill_gaps(positions)
        fill_gaps(efforts)
        exposures = self._exposures.read()
        exposure_times, poses = exposures[:, 0], exposures[:, 1:].reshape(-1, 4, 4)
        counts = np.round(data["guard_status"]).astype(int)
        unknown = np.full((n, 4, 4), np.nan)
        log = RunLog(
            law=self.law,
            seed=self.scenario.seed,
            time=times,
            X_WE_desired=path.sample(times)[0],
            X_WE_true=unknown,
            X_WE_measured=measured_along(path, times, exposure_times, poses),
            joint_position=positions,
            joint_effort=efforts,
            link_position=positions,
            position_command=data["position_command"],
            velocity_command=data["velocity_command"],
            correction=data["correction"],
            guard_counts=dict(zip(KINDS, counts[-1].tolist() if n else [0] * len(KINDS), strict=True)),
            guard_events=sorted([*guard_events(times, counts), *self._events], key=lambda event: event.time),
            **path_marks(path),
            learnt=learnt(self.servo, self._context),
            calibrated=calibrated(self.servo, self._context, self.scenario.robot),
            wall_time=float(times[-1]) if n else 0.0,
        )
        if self._stream is not None and len(self._reports):
            for event in guard_events(times, counts):
                write_event(self._stream, event)
            self._stream.close(**marks(log, ended))
        report = camera.report() if camera else None
        return RealTimeRecord(
            log=log,
            stamps=stamps,
            ended=ended,
            counters=counters,
            camera=report.counters if report else {},
            turn_around=np.array(wire.turn_around),
            camera_clock=report.clock if report else None,
            robot_clock=wire.robot_clock.quality(),
            host=wire.host,
            pauses=self._pauses,
            events=self._events,
            limited_messages=wire.limited_messages,
            people=LivePeople.of(self._watch, times, data) if self._watch else None,
        )
