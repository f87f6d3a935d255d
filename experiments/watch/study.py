"""How well people are seen: at random places, and in an empty cell in which only robot and light change."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator

from diagrams.scenario.scenario import Scenario
from diagrams.watching import WatchedCell, empty_cell, fastest, joints_along, watched_cell
from robots.description.model import RobotModel
from robots.kinematics.arm_capsules import Capsules
from systems.cell.overview.overview_camera import LightConfig, recorded
from systems.cell.overview.person import PersonConfig, WayPoint, figure, gap
from systems.guard.separation.separation_monitor import SeparationMonitor
from systems.reference.paths import make_path
from systems.samples import JointSample, PersonSample
from systems.vision.people.background import Memory
from systems.vision.people.person_tracks import Track, followed
from systems.vision.people.surroundings import Surroundings, load_surroundings

_RADII = (0.8, 2.6)  # m, of places about the base
_LEAST_GAP = 0.1  # m, between person and robot
_LAP_SETS = 12  # sets of images of the moving robot, which come again lap by lap
_LIGHT_SWING, _LIGHT_PERIOD = 0.05, 20.0  # share, s

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Place:
    """A person at a place, and what was seen of it."""

    place: np.ndarray  # x, y in the world in m, (2,)
    true: float  # m, the distance of person and robot
    measured: float  # m; infinite if nobody was found
    milliseconds: float  # of computation on one core


@dataclass(frozen=True)
class WatchStudy:
    """What a study has found."""

    places: list[Place]
    false_stops: int
    empty_sets: int  # of images of the empty cell
    empty_minutes: float
    smallest_share: float  # of the speed that was allowed in the empty cell
    surroundings: Surroundings

    @property
    def errors(self) -> np.ndarray:
        """Measured less true distances in m of those who were found."""
        return np.array([each.measured - each.true for each in self.places if np.isfinite(each.measured)])

    def as_dict(self) -> dict[str, Any]:
        """The numbers, in the units of their names."""
        errors = self.errors
        return {
            "places": len(self.places),
            "found": len(errors),
            "largest_overestimate_m": round(float(errors.max()), 4) if len(errors) else None,
            "median_abs_error_m": round(float(np.median(np.abs(errors))), 4) if len(errors) else None,
            "ms_per_set": round(float(np.median([each.milliseconds for each in self.places])), 1),
            "false_stops": self.false_stops,
            "empty_minutes": self.empty_minutes,
            "empty_sets": self.empty_sets,
            "smallest_share": self.smallest_share,
        }


def study_watch(
    scenario: Scenario, robot: RobotModel, count: int, minutes: float, every: float, progress: Progress
) -> WatchStudy:
    """Both parts of the study.

    Args:
        scenario: with cameras, surroundings, light and detector; its own people stay away.
        robot: that stands in the cell.
        count: of places.
        minutes: of the empty cell.
        every: s, between two sets of images of the empty cell.
        progress: is called with the share that is done.

    Raises:
        ValueError: if a part refuses its configuration, or the path is out of reach.
    """
    overview = scenario.station.overview
    one = [PersonConfig([WayPoint(np.array([2.0, 0.0]))])]
    overview = replace(overview, people=one, light=LightConfig(noise=overview.light.noise))
    scenario = replace(scenario, station=replace(scenario.station, overview=overview))
    watched = watched_cell(scenario, robot)
    joints = joints_along(scenario, robot, make_path(scenario.reference))[1]
    memory = watched.detector.learn(*empty_cell(scenario, watched, joints))
    sets = max(1, round(60.0 * minutes / every)) if minutes else 0
    work = count + _LAP_SETS + 0.2 * sets  # in sets that are drawn
    rng = np.random.default_rng(scenario.seed)
    surroundings = load_surroundings(overview.surroundings)
    places = []
    while len(places) < count:
        person, where, q = _random_place(rng, joints, surroundings.floor)
        if gap(person, watched.detector.arm.at(q)) >= _LEAST_GAP:
            places.append(_seen_at(watched, memory, scenario, person, where, q, rng.standard_normal(2)))
            progress(len(places) / work)
    stops, share = 0, 1.0
    if sets:
        stops, share = _empty(
            watched, memory, scenario, robot, joints, sets, every, lambda x: progress((count + x) / work)
        )
    return WatchStudy(places, stops, sets, minutes, share, surroundings)


def _random_place(
    rng: np.random.Generator, joints: np.ndarray, floor: float
) -> tuple[Capsules, np.ndarray, np.ndarray]:
    """A walking person somewhere about the robot, its place, and the robot somewhere on its path."""
    low, high = (_RADII[0], -np.pi, -np.pi, 0.0), (_RADII[1], np.pi, np.pi, 2.0 * np.pi)
    radius, angle, yaw, phase = rng.uniform(low, high)
    where = radius * np.array([np.cos(angle), np.sin(angle)])
    return figure(where, yaw, floor, phase, 1.0), where, joints[rng.integers(len(joints))]


def _seen_at(
    watched: WatchedCell,
    memory: Memory,
    scenario: Scenario,
    person: Capsules,
    where: np.ndarray,
    q: np.ndarray,
    key: np.ndarray,
) -> Place:
    arm = watched.detector.arm.at(q)
    images = recorded(watched.pictures.take(arm, [person]), 0.0, scenario.station.overview.light, key)
    started = time.process_time()
    found, _ = watched.detector.detect(memory, images, q)
    spent = time.process_time() - started
    reach = 0.5 * np.sqrt(3.0) * scenario.servo.people.hull.edge
    measured = min((float(arm.distances(body.points).min()) - reach for body in found.bodies), default=np.inf)
    return Place(where, gap(person, arm), measured, 1e3 * spent)


def _empty(
    watched: WatchedCell,
    memory: Memory,
    scenario: Scenario,
    robot: RobotModel,
    joints: np.ndarray,
    sets: int,
    every: float,
    progress: Progress,
) -> tuple[int, float]:
    """Stops of the monitor in an empty cell, and the smallest share of the speed that it allowed.

    The robot runs its path to and fro, and the light swings. Pictures of it are drawn once for one lap.
    """
    lap = [joints[i] for i in np.linspace(0, len(joints) - 1, _LAP_SETS).astype(int)]
    drawn = []
    for number, q in enumerate(lap):
        drawn.append(watched.pictures.take(watched.detector.arm.at(q), [None]))
        progress(number + 1)
    light = replace(scenario.station.overview.light, swing=_LIGHT_SWING, swing_period=_LIGHT_PERIOD)
    # One decision for each set, of which none is late.
    limits = replace(
        scenario.servo.separation, period=every, slow_after=3.0 * every, stop_after=5.0 * every, rise=1e3
    )
    path, slowing = make_path(scenario.reference), scenario.reference.slowing
    reaction = replace(watched.reaction, decision=0.0)
    monitor = SeparationMonitor(robot, watched.detector.arm, limits, reaction, slowing, fastest(path))
    simulator = Simulator(monitor)
    context = simulator.get_mutable_context()
    tracks: tuple[Track, ...] = ()
    order = [*range(_LAP_SETS), *reversed(range(1, _LAP_SETS - 1))]
    stops, smallest, was_stopped = 0, 1.0, True
    for number in range(sets):
        now, at = number * every, order[number % len(order)]
        images = recorded(drawn[at], now, light, np.array([number, 1.0]))
        found, memory = watched.detector.detect(memory, images, lap[at])
        tracks, people, _ = followed(
            tracks, 1, now, found.bodies, scenario.servo.people.hull.edge, scenario.servo.people.tracks
        )
        for name, value in (
            ("person_sample", Value[object](PersonSample(now, found.trusted, people))),
            ("joint_sample", Value(JointSample(now, lap[at]))),
            ("velocity_command", np.zeros(len(lap[at]))),
            ("path_time", [now, 1.0]),
            ("acknowledge", [1.0]),
        ):
            monitor.GetInputPort(name).FixValue(context, value)
        simulator.AdvanceTo(now + 0.5 * every)
        stopped = bool(monitor.GetOutputPort("stop").Eval(context)[0])
        stops += stopped and not was_stopped
        was_stopped = stopped
        if number:
            smallest = min(smallest, float(monitor.GetOutputPort("speed_share").Eval(context)[0]))
        progress(_LAP_SETS + 0.2 * number)
    return stops, smallest
