"""What sees people and slows the robot for them, made from a scenario. An aid, not a safety function."""

from dataclasses import dataclass

import numpy as np

from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario
from robots.description.model import RobotModel
from robots.dynamics.newton_inverse import inverse_kinematics
from systems.cell.overview.overview_camera import OverviewCamera, Pictures, recorded
from systems.cell.overview.person import COLORS, WalkingPerson
from systems.cell.overview.rendering import CellPictures
from systems.guard.separation.protective_distance import ReactionTime
from systems.guard.separation.separation_monitor import SeparationMonitor
from systems.reference.paths import CartesianPath, make_path
from systems.vision.camera_rig import load_cell
from systems.vision.people.people_detector import PeopleDetector, reduced, watched_arm
from systems.vision.people.people_watcher import PeopleWatcher
from systems.vision.people.surroundings import load_surroundings

_EMPTY_SETS = 5  # of images of the empty cell, with the robot at places along its path
_SPACING = 0.05  # s, between configurations along a path


@dataclass(frozen=True)
class WatchedCell:
    """The cameras of a scenario, what stands before them, and what looks for people in their images."""

    detector: PeopleDetector
    pictures: Pictures
    people: list[WalkingPerson]
    reaction: ReactionTime
    size: tuple[int, int]  # width and height of an image in px


def watched_cell(scenario: Scenario, robot: RobotModel, pictures: Pictures | None = None) -> WatchedCell:
    """Everything before the first image.

    Args:
        scenario: with `station.overview`.
        robot: that stands in the cell.
        pictures: what draws the images; None for Drake's VTK renderer.

    Raises:
        ValueError: if a file is missing or wrong.
    """
    overview, config = scenario.station.overview, scenario.servo.people
    cell, surroundings = load_cell(overview.cell), load_surroundings(overview.surroundings)
    cameras, size = reduced(cell.camera_model(robot.base.pose()), cell.sensor_px, overview.width)
    detector = PeopleDetector(robot, cameras, size, surroundings, config)
    people = [WalkingPerson(each, surroundings.floor) for each in overview.people]
    if pictures is None:
        figures = [person.figure for person in people]
        rest = detector.arm.at(np.deg2rad(scenario.home_deg))
        meshes = [each.mesh for each in overview.people]
        pictures = CellPictures(cameras, size, surroundings, rest, figures, COLORS, meshes)
    return WatchedCell(detector, pictures, people, reaction_time(scenario), size)


def reaction_time(scenario: Scenario) -> ReactionTime:
    """T_r of the chain of a scenario, from the delays that are named in it."""
    return ReactionTime(
        images=scenario.station.overview.period,
        transport=scenario.station.overview.delay,
        computation=scenario.servo.people.computation,
        decision=scenario.servo.separation.period,
        command=scenario.reference.preview + 2.0 * scenario.station.period + scenario.station.drive.dead_time,
    )


def joints_along(scenario: Scenario, robot: RobotModel, path: CartesianPath) -> tuple[np.ndarray, np.ndarray]:
    """Times in s, (n,), and joint positions in rad, (n, 6), from the start of the motion to its end.

    Raises:
        ValueError: if the path is out of reach.
    """
    times = np.arange(path.path_start, path.dwell_start + _SPACING, _SPACING)
    inverse = inverse_kinematics(robot)
    return times, inverse.along(path.sample(times)[0], np.deg2rad(scenario.home_deg))


def empty_cell(scenario: Scenario, watched: WatchedCell, joints: np.ndarray) -> tuple[list, list]:
    """Sets of images of the cell without people, and where the robot was in each, (6,) rad.

    Args:
        scenario: how light is recorded.
        watched: the cell.
        joints: configurations (n, 6) among which places are chosen evenly.
    """
    chosen = [joints[i] for i in np.linspace(0, len(joints) - 1, _EMPTY_SETS).astype(int)]
    nobody = [None] * len(watched.people)
    images = []
    for number, q in enumerate(chosen):
        drawn = watched.pictures.take(watched.detector.arm.at(q), nobody)
        images.append(recorded(drawn, 0.0, scenario.station.overview.light, np.array([number, -1.0])))
    return images, chosen


@dataclass(frozen=True)
class Watch:
    """The systems that see people and decide, for a diagram."""

    cell: WatchedCell
    camera: OverviewCamera
    watcher: PeopleWatcher
    monitor: SeparationMonitor


def separation_monitor(
    scenario: Scenario, believed: RobotModel, tick: float | None = None
) -> SeparationMonitor:
    """What decides how fast the robot may go.

    Args:
        scenario: with `station.overview`.
        believed: the robot as the controller knows it.
        tick: as of the monitor.

    Raises:
        ValueError: if times and distances contradict each other.
    """
    return SeparationMonitor(
        believed,
        watched_arm(believed, scenario.servo.people),
        scenario.servo.separation,
        reaction_time(scenario),
        scenario.reference.slowing,
        fastest(make_path(scenario.reference)),
        tick,
    )


def make_watch(
    scenario: Scenario, robot: RobotModel, plant: RobotModel | None = None, pictures: Pictures | None = None
) -> Watch:
    """The watch of a simulated station, which has seen its empty cell.

    Args:
        scenario: with `station.overview`.
        robot: as the controller knows it.
        plant: as it is, if that is another one.
        pictures: as of `watched_cell`.

    Raises:
        ValueError: if a part refuses its configuration, or the path is out of reach.
    """
    watched, overview = watched_cell(scenario, robot, pictures), scenario.station.overview
    path = make_path(scenario.reference)
    believed = controller_model(scenario, robot).robot
    images, places = empty_cell(scenario, watched, joints_along(scenario, believed, path)[1])
    arm = watched_arm(plant or robot, scenario.servo.people)
    watcher = PeopleWatcher(
        watched.detector,
        watched.detector.learn(images, places),
        overview.period,
        overview.delay + scenario.servo.people.computation,
        scenario.station.period,
        scenario.servo.people.tracks,
        scenario.servo.people.lasting,
    )
    monitor = separation_monitor(scenario, believed)
    return Watch(watched, OverviewCamera(overview, watched.pictures, arm, watched.people), watcher, monitor)


def fastest(path: CartesianPath) -> float:
    """The largest speed of the tool on a path in m/s."""
    _, V_WE, _ = path.sample(np.arange(path.path_start, path.dwell_start, 0.01))
    return float(np.linalg.norm(V_WE[:, 3:], axis=1).max(initial=0.0))
