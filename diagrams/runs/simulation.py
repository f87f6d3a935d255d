"""Joins a station and a servo, advances them, and keeps the record."""

import gc
import time
from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, System

from diagrams.integration import Integration
from diagrams.live_watch import OF_WATCH
from diagrams.record.coverage import Prediction, coverage
from diagrams.record.log import GuardEvent, RunLog
from diagrams.record.packed_log import PackedLog
from diagrams.record.played import measured_along, path_marks, played
from diagrams.runs.measurement import MeasurementRun
from diagrams.runs.start import start_position
from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario, ScenarioError
from diagrams.servo import Controller, Servo, calibrated, law_name, learnt, predicted_tip
from diagrams.station import SimulatedStation, Station
from diagrams.watching import Watch, make_watch
from robots.description.calibration import is_same_robot
from robots.description.model import RobotModel, load_robot
from systems.cell.events.station_events import check_events
from systems.feedforward import FEEDFORWARDS
from systems.feedforward.joint_motion import Standing
from systems.guard.guard import KINDS
from systems.reference.paths import make_path

_CHUNK = 0.2  # s of simulated time between two reports of progress
_FRAME = 1.0 / 30.0  # s of simulated time between two pictures, where somebody looks on
_LONGEST_HOLD = 30.0  # s, after which a run is over whose path is held


def run(
    scenario: Scenario,
    law: str,
    robot: RobotModel | None = None,
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    plant: RobotModel | None = None,
) -> RunLog:
    """Runs one law through a scenario, from rest at the start of the path to the end of the dwell.

    Args:
        scenario: what to do.
        law: which law to use.
        robot: the robot as the controller knows it; None for the one that the scenario names. Unless it is a
            calibrated one, the true robot is made from it too.
        seed: of the camera's noise; None for the scenario's.
        progress: is called now and then with the share that is done, 0 to 1.
        plant: the robot in the station, if it is another one than the controller knows.

    Raises:
        ScenarioError: if the nominal robot cannot follow the path.
        ValueError: if a part refuses its configuration.
    """
    experiment = Experiment(scenario, law, robot, seed, plant)
    experiment.advance(progress=progress)
    return experiment.log()


class Experiment:
    """A station under a servo, ready to be advanced."""

    def __init__(
        self,
        scenario: Scenario,
        law: str | type[System] | System,
        robot: RobotModel | None = None,
        seed: int | None = None,
        plant: RobotModel | None = None,
        watch: Watch | None = None,
        is_nested: bool = False,
    ) -> None:
        """Builds the diagram and puts everything at rest at the start. Raises what `run` raises.

        Args:
            scenario, robot, seed, plant: as of `run`.
            law: a shipped law by name, ``FILE.py:CLASS``, a class, or any system with the ports of a law.
            watch: what watches for people; None for what the scenario says.
            is_nested: whether station and servo are diagrams of their own, as one would draw them. That does
                the same, but takes longer.
        """
        self.scenario, self.law = scenario, law_name(law)
        end = make_path(scenario.reference).duration
        check_events(scenario.station.events, end, scenario.station.drive.dead_time)
        self.seed = scenario.seed if seed is None else seed
        if not (isinstance(self.seed, int | np.integer) and 0 <= self.seed < 2**32):
            raise ScenarioError(f"seed must be a whole number between 0 and {2**32 - 1}, got {seed}")
        drawn = plant or nominal_robot(scenario, robot)
        robot = robot or drawn
        builder = DiagramBuilder()
        if watch is None and scenario.station.overview.enabled:
            watch = make_watch(scenario, robot, drawn)
        self.watch = watch
        standing = self._standing(robot, drawn)
        of_servo = robot, scenario, law, self.watch, standing
        self.servo: Controller = (
            builder.AddNamedSystem("servo", Servo(*of_servo)) if is_nested else Controller(builder, *of_servo)
        )
        servo = self.servo
        overview = self.watch.camera if self.watch else None
        parts = drawn, scenario.station, servo.drive, servo.has_torque, None, overview
        self.station: Station = (
            builder.AddNamedSystem("station", SimulatedStation(*parts))
            if is_nested
            else Station(builder, *parts)
        )
        for name, port in self.station.inputs.items():
            builder.Connect(servo.outputs[name], port)
        for name in ("joint_sample", "pose_sample", *(("image_sample",) if self.watch else ())):
            for port in servo.inputs[name]:
                builder.Connect(self.station.outputs[name], port)
        shown = ("position_command", "velocity_command", "correction", "guard_status")
        ports = {name: servo.outputs[name] for name in shown}
        ports |= {name: self.station.outputs[name] for name in self.station.LOGGED}
        if self.servo.reference.is_slowed:
            ports["path_time"] = servo.outputs["path_time"]
        if self.watch:
            ports |= {name: servo.outputs[name] for name in OF_WATCH}
        # In one log: what stands in a diagram costs time at every step of the integrator.
        self._log = PackedLog(builder, ports, scenario.station.period)
        self.diagram = builder.Build()
        self.diagram.set_name("truetip")
        self.path = self.servo.reference.path
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()
        self.station.set_at_rest(
            self.context, start_position(self.servo.model, scenario, self.path), self.seed
        )
        rate = self.station.fastest_rate(self.context)
        changes = self.station.changes()
        self.integration = Integration(scenario.integrator, scenario.station.period, rate, changes)
        self.integration.initialize(self.simulator)
        self._events: list[GuardEvent] = []  # what the run itself has to say
        self._wall_time = 0.0
        self._predictions: list[Prediction] = []  # of the tip, one a chunk, by a law that says where it is

    def _standing(self, robot: RobotModel, drawn: RobotModel) -> Standing | None:
        """The robot before the run as encoders and camera show it, if the inverse model is to know."""
        scenario = self.scenario
        config = scenario.servo.feedforward
        if config.resting != "seen" or config.kind == "none":
            return None
        if not FEEDFORWARDS.find(config.kind).is_computed_beforehand:
            return None
        start = start_position(controller_model(scenario, robot), scenario, make_path(scenario.reference))
        try:
            seen = MeasurementRun(scenario, plant=drawn).measure(start[None], self.seed).measured
        except ValueError as error:
            raise ScenarioError(f"servo.feedforward.resting=seen: {error}") from error
        return Standing(seen.q[0], seen.position[0])

    def advance(
        self,
        until: float | None = None,
        progress: Callable[[float], None] | None = None,
        show: Callable[[], None] | None = None,
    ) -> None:
        """Advances to a time in s, or to the end of the path, which is later where it is slowed.

        Args:
            until: in s; None for the end of the path.
            progress: is called now and then with the share that is done, 0 to 1.
            show: is called about 30 times a simulated second, on ticks, and at the end.

        Raises:
            ValueError: if the time is not finite.
        """
        if until is not None and not np.isfinite(until):
            raise ValueError(f"cannot be advanced to {until} s")
        # Chunks that end on a tick cost nothing: the integrator stops there anyway.
        ticks = max(1, round(_CHUNK / self.scenario.station.period))
        started = time.perf_counter()
        # No cycles of objects arise in a run, but a full search for them takes 40 ms with Drake loaded.
        collecting = gc.isenabled()
        gc.disable()
        try:
            if until is None:
                self._advance_to_path_end(ticks, progress, show)
            else:
                report = progress and (lambda: progress(self.context.get_time() / until))
                self._advance(until, ticks, report, show)
        finally:
            if collecting:
                gc.enable()
        self._wall_time += time.perf_counter() - started

    def _advance_to_path_end(
        self, ticks: int, progress: Callable[[float], None] | None, show: Callable[[], None] | None
    ) -> None:
        """Advances until the time on the path is over, or has not gone on for long."""
        end, moved_at = self.path.duration, 0.0

        def report() -> None:
            if progress:
                progress(min(1.0, self.servo.path_time(self.context) / end))

        remaining = end - self.servo.path_time(self.context)
        while remaining > 1e-9 and self.context.get_time() < moved_at + _LONGEST_HOLD:
            wait = max(remaining, self.scenario.station.period)
            self._advance(self.context.get_time() + wait, ticks, report, show)
            last, remaining = remaining, end - self.servo.path_time(self.context)
            if remaining < last:
                moved_at = self.context.get_time()
        if remaining > 1e-9:
            why = (
                f"the path did not go on for {_LONGEST_HOLD:g} s: the run ends {remaining:.1f} s short of it"
            )
            self._events.append(GuardEvent(moved_at, "path_held", why))

    def _advance(
        self, end: float, ticks: int, report: Callable[[], None] | None, show: Callable[[], None] | None
    ) -> None:
        period = self.scenario.station.period
        frame = max(1, round(_FRAME / period))
        done = round(self.context.get_time() / period)
        while self.context.get_time() < end:
            if show:
                for tick in range((done // frame + 1) * frame, done + ticks, frame):
                    if tick * period < end:
                        self.integration.advance(self.simulator, tick * period)
                        show()
            done += ticks
            self.integration.advance(self.simulator, min(end, done * period))
            if show and (done % frame == 0 or self.context.get_time() >= end):
                show()
            prediction = predicted_tip(self.servo, self.context)
            if prediction is not None:
                self._predictions.append(prediction)
            if report:
                report()

    def watched(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """What the separation monitor said, and the joints: times (n,) in s, and values (n, size) by port."""
        times, data = self._log.read(self.context)
        return times, {name: data[name] for name in (*OF_WATCH, "path_time", "truth.motor_state")}

    def forget(self) -> None:
        """Empties the record, so that memory stays flat over hours; `log` then begins here."""
        self._log.clear(self.context)
        self._predictions.clear()
        self.servo.tick_clock.forget()

    def log(self) -> RunLog:
        """The record of what has happened so far, or since `forget`."""
        times, data = self._log.read(self.context)
        record = self.station.record(times, data)
        path = played(self.path, times, data)
        counts = np.round(data["guard_status"]).astype(int)
        found = learnt(self.servo, self.context)
        if found is not None and self._predictions:
            on_path = [row for row in self._predictions if row[0] >= path.path_start]
            found["coverage"] = coverage(on_path, record.time, record.X_WE_true)
        return RunLog(
            law=self.law,
            seed=self.seed,
            time=record.time,
            X_WE_desired=path.sample(record.time)[0],
            X_WE_true=record.X_WE_true,
            X_WE_measured=measured_along(path, record.time, record.exposure_time, record.X_WE_measured),
            joint_position=record.joint_position,
            joint_effort=record.joint_effort,
            link_position=record.link_position,
            position_command=data["position_command"],
            velocity_command=data["velocity_command"],
            correction=data["correction"],
            guard_counts=dict(zip(KINDS, counts[-1].tolist(), strict=True)),
            guard_events=sorted(
                [*guard_events(record.time, counts), *self._events], key=lambda event: event.time
            ),
            **path_marks(path),
            learnt=found,
            calibrated=calibrated(self.servo, self.context, self.scenario.robot),
            tick_seconds=self.servo.tick_clock.seconds,
            wall_time=self._wall_time,
        )


def nominal_robot(scenario: Scenario, robot: RobotModel | None) -> RobotModel:
    """The nominal robot, from which the true one differs by the station's errors.

    Args:
        scenario: names it.
        robot: what the controller knows; a calibrated robot knows the errors, any other one is nominal.

    Raises:
        ScenarioError: if the calibrated robot is not the scenario's.
    """
    if robot is not None and not robot.calibration.of:
        return robot
    if robot is not None and not is_same_robot(robot.calibration.of, scenario.robot):
        raise ScenarioError(
            f"{robot.name} was calibrated on '{robot.calibration.of}', the scenario has '{scenario.robot}'; "
            f"--set robot={robot.calibration.of} puts that one there"
        )
    return load_robot(scenario.robot)


def guard_events(times: np.ndarray, counts: np.ndarray) -> list[GuardEvent]:
    """One event for each unbroken run of ticks in which a kind was counted.

    Args:
        times: of the ticks in s, shape (n,).
        counts: of `systems.guard.guard.KINDS` until each tick, shape (n, kinds).
    """
    events = []
    increments = np.diff(counts, axis=0, prepend=0) > 0
    for column, kind in enumerate(KINDS):
        edges = np.diff(increments[:, column].astype(int), prepend=0, append=0)
        for start, stop in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
            length = float(times[stop - 1] - times[start])
            detail = f"for {1e3 * length:.0f} ms, {stop - start} ticks"
            events.append(GuardEvent(float(times[start]), kind, detail, length))
    return sorted(events, key=lambda event: event.time)
