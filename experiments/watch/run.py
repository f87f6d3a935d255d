"""One run with people in the cell, simulated or from recorded images: distances, speed and stops."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.live_watch import Blind
from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import Scenario
from diagrams.watching import WatchedCell, fastest, watched_cell
from experiments.cli.console import count
from experiments.watch.recording import Recording
from robots.description.model import NUM_JOINTS, RobotModel
from systems.cell.overview.overview_camera import recorded
from systems.cell.overview.person import gap
from systems.guard.separation.protective_distance import ReactionTime, protective_distance
from systems.guard.separation.separation_monitor import STATUS
from systems.reference.paths import make_path
from systems.samples import ImageSample
from systems.vision.camera_rig import load_cell
from systems.vision.people.lasting_changes import LastingChange
from systems.vision.people.people_follower import Mind, PeopleFollower
from systems.vision.people.person_networks import PersonNetwork
from systems.vision.people.watch_diary import Seen, Snapshot, WatchDiary

_EVERY = 0.02  # s, between two times of a timeline
_NOBODY = 100.0  # m, a distance beyond it is that of nobody

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Timeline:
    """What was decided, at n times; NaN where a number is not known or nobody is there."""

    time: np.ndarray  # s
    distance: np.ndarray  # m, measured
    true: np.ndarray  # m, in a simulation
    protective: np.ndarray  # m, at full speed
    rate: np.ndarray  # of the path time, 1 at full speed
    stopped: np.ndarray  # bool
    place: np.ndarray  # x, y of the nearest person in m, (n, 2)

    def thinned(self, most: int) -> "Timeline":
        """Every so many times that at most so many are left, and all at which stops begin or end."""
        step = -(-len(self.time) // most)
        changes = np.flatnonzero(np.diff(self.stopped.astype(int)))
        kept = np.unique(np.concatenate([np.arange(0, len(self.time), step), changes, changes + 1]))
        return Timeline(*(getattr(self, each.name)[kept] for each in fields(self)))


@dataclass(frozen=True)
class WatchRun:
    """A run and what is needed to show it."""

    timeline: Timeline
    cell: WatchedCell
    snapshot: Snapshot | None
    terms: dict[str, float]  # of the protective distance at full speed in m
    notes: list[str]
    changes: tuple[LastingChange, ...] = ()  # of the cell, that stay
    boxes: list[np.ndarray] | None = None  # in px, of people in each image of the snapshot by a network

    @property
    def stops(self) -> int:
        """How often the robot was stopped, the start apart."""
        stopped = self.timeline.stopped.astype(int)
        return int(np.count_nonzero(np.diff(stopped) > 0))

    def as_dict(self) -> dict[str, Any]:
        """The numbers, in the units of their names."""
        line = self.timeline
        known = np.isfinite(line.distance) & np.isfinite(line.true)
        error = (line.distance - line.true)[known]
        step = float(np.median(np.diff(line.time))) if len(line.time) > 1 else 0.0
        return {
            "duration_s": round(float(line.time[-1]), 3),
            "smallest_distance_m": _number(line.distance),
            "smallest_true_distance_m": _number(line.true),
            "largest_lag_m": round(float(error.max()), 4) if len(error) else None,
            "stops": self.stops,
            "slowed_s": round(step * float(np.count_nonzero((line.rate < 0.999) & ~line.stopped)), 2),
            "stopped_s": round(step * float(np.count_nonzero(line.stopped)), 2),
            "reaction_s": {**parts(self.cell.reaction), "total": round(self.cell.reaction.total, 4)},
            "protective_distance_m": self.terms,
            "changes": [self.described(each) for each in self.changes],
            "notes": self.notes,
            **({} if self.boxes is None else {"confirmed_by_cameras": self.confirmed}),
        }

    def described(self, change: LastingChange) -> dict[str, Any]:
        """Since when, where and how large, in the units of the names."""
        standing = change.standing
        return {
            "since_s": round(standing.since, 3),
            "known_s": round(change.known, 3),
            "place_m": np.round(standing.place, 3).tolist(),
            "size_m": np.round(standing.size(self.edge), 3).tolist(),
            "volume_m3": round(standing.body.volume, 4),
        }

    @property
    def edge(self) -> float:
        """Of the cubes of the hull in m."""
        return self.cell.detector.edge

    @property
    def confirmed(self) -> int:
        """In how many images of the snapshot a box of the network has most of the hull that is seen there."""
        assert self.snapshot is not None
        cameras, found = self.cell.detector.cameras, 0
        for i, boxes in enumerate(self.boxes or []):
            for body in self.snapshot.bodies[:1]:
                pixels = cameras.subset([i]).project(body.points)[0]
                inside = [((pixels >= box[:2]) & (pixels <= box[2:])).all(axis=1).mean() for box in boxes]
                found += int(max(inside, default=0.0) > 0.5)
        return found


def seen_by_network(network: PersonNetwork, run: WatchRun) -> list[np.ndarray]:
    """Boxes of people in each image of the snapshot; what mostly shows the known robot does not count."""
    assert run.snapshot is not None
    masks = run.cell.detector.masks(run.snapshot.q)
    return [network.people(image, mask)[0] for image, mask in zip(run.snapshot.images, masks, strict=True)]


def parts(reaction: ReactionTime) -> dict[str, float]:
    """The parts of a reaction time in s by their names."""
    return {each.name: round(getattr(reaction, each.name), 4) for each in fields(reaction)}


def watch_simulated(scenario: Scenario, robot: RobotModel, law: str, progress: Progress) -> WatchRun:
    """Runs a law in the watched cell. Raises ValueError if the scenario has no whole images."""
    experiment = Experiment(scenario, law, robot)
    watch = experiment.watch
    if watch is None:
        raise ValueError(
            "watch: no camera of the scenario takes images of the whole cell; use --scenario watched or "
            "--set station.overview.enabled=true"
        )
    experiment.advance(progress=progress)
    times, data = experiment.watched()
    step = max(1, round(_EVERY / scenario.station.period))
    some = slice(None, None, step)
    times, status = times[some], data["separation"][some]
    joints = data["truth.motor_state"][some, :NUM_JOINTS]
    arm, true, place = watch.cell.detector.arm, [], []
    for time, q in zip(times, joints, strict=True):
        figures = [each for each in (person.at(time) for person in watch.cell.people) if each is not None]
        gaps = [gap(each, arm.at(q)) for each in figures]
        true.append(min(gaps, default=np.nan))
        place.append(figures[int(np.argmin(gaps))].start[1, :2] if gaps else (np.nan, np.nan))
    distance = status[:, STATUS.index("distance")]
    line = Timeline(
        times,
        np.where(distance < _NOBODY, distance, np.nan),
        np.array(true),
        status[:, STATUS.index("protective_distance")],
        data["path_time"][some, 1],
        data["stop"][some, 0] > 0.5,
        np.array(place),
    )
    snapshot = _snapshot(scenario, watch.cell, line, joints)
    context = watch.watcher.GetMyContextFromRoot(experiment.simulator.get_context())
    changes = watch.watcher.changes(context)
    return WatchRun(line, watch.cell, snapshot, terms_at_full_speed(scenario, watch.cell), [], changes)


def watch_recorded(
    scenario: Scenario, robot: RobotModel, folder: str | Path, empty: int, progress: Progress
) -> WatchRun:
    """Finds people in recorded images and says what the monitor would have decided at full speed.

    Args:
        scenario: with cell and detector.
        robot: that stands in the cell.
        folder: of the recording.
        empty: how many of the first sets show the empty cell.
        progress: is called with the share that is done.

    Raises:
        ValueError: if the recording cannot be read or is too short.
    """
    names = [camera.name for camera in load_cell(scenario.station.overview.cell).cameras]
    # Before the cell is built, which takes long: it may be another folder.
    recording = Recording(folder, names)
    if not 0 < empty < len(recording):
        raise ValueError(
            f"--empty must be between 1 and {len(recording) - 1}, one less than the sets, got {empty}"
        )
    recording.check_range(robot.lower, robot.upper)
    cell = watched_cell(scenario, robot, Blind())
    sets, detector = recording.sets(cell.size), cell.detector
    memory = detector.learn([next(sets) for _ in range(empty)], list(recording.joints[:empty]))
    people = scenario.servo.people
    follower, diary = PeopleFollower(detector, people.tracks, people.lasting), WatchDiary(detector.arm)
    mind = Mind(memory)
    for number, images in enumerate(sets, empty):
        sample, q = ImageSample(float(recording.times[number]), images), recording.joints[number]
        mind = follower.after(mind, sample, q)
        diary.note(mind, sample, q)
        progress((number + 1 - empty) / (len(recording) - empty))
    seen, terms = diary.seen(), terms_at_full_speed(scenario, cell)
    stopped = (np.nan_to_num(seen.distance, nan=np.inf) < terms["total"]) | ~seen.trusted
    line = Timeline(
        seen.time,
        seen.distance,
        np.full(len(seen.time), np.nan),
        np.full(len(seen.time), terms["total"]),
        np.where(stopped, 0.0, 1.0),
        stopped,
        seen.place,
    )
    notes = recording.notes + untrusted_note(seen)
    return WatchRun(line, cell, seen.nearest, terms, notes, seen.changes)


def untrusted_note(seen: Seen) -> list[str]:
    """How many sets of images were not trusted, in words; nothing if all were."""
    number = int(np.count_nonzero(~seen.trusted))
    return [f"{count(number, 'set')} {'is' if number == 1 else 'are'} not trusted"] if number else []


def _number(values: np.ndarray) -> float | None:
    return round(float(np.nanmin(values)), 4) if np.isfinite(values).any() else None


def terms_at_full_speed(scenario: Scenario, cell: WatchedCell) -> dict[str, float]:
    """The terms of the protective distance with the path at full speed in m."""
    config, speed = scenario.servo.separation, fastest(make_path(scenario.reference))
    found = protective_distance(config, cell.reaction, speed, scenario.reference.slowing, config.human_speed)
    return {each.name: round(getattr(found, each.name), 4) for each in fields(found)} | {
        "total": round(found.total, 4)
    }


def _snapshot(scenario: Scenario, cell: WatchedCell, line: Timeline, joints: np.ndarray) -> Snapshot | None:
    """The images at the time at which somebody was nearest, once more, and what is seen in them."""
    if not np.isfinite(line.true).any():
        return None
    at = int(np.nanargmin(line.true))
    time, q = float(line.time[at]), joints[at]
    arm = cell.detector.arm.at(q)
    light = scenario.station.overview.light
    nobody: list = [None] * len(cell.people)
    figures = [person.at(time) for person in cell.people]
    empty, images = (
        recorded(cell.pictures.take(arm, people), time, light, np.array([time, -2.0]))
        for people in (nobody, figures)
    )
    # Of this arm alone: what is behind it stays unknown.
    memory = cell.detector.learn([empty], [q])
    return Snapshot(time, images, cell.detector.detect(memory, images, q)[0].bodies, q)
