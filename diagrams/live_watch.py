"""What watches for people on a real station: a process that looks, and a monitor in the control cycle."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from pydrake.systems.framework import Context, System

from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario
from diagrams.watching import empty_cell, joints_along, separation_monitor, watched_cell
from robots.description.model import RobotModel
from robots.kinematics.arm_capsules import Capsules
from systems.cell.overview.drawn_images import DrawnImages, FlatPictures
from systems.guard.separation.separation_monitor import FAR, STATUS, SeparationMonitor
from systems.link.clock import steady_time
from systems.reference.paths import make_path
from systems.samples import PersonSample
from systems.vision.camera_rig import load_cell
from systems.vision.people.camera_streams import CameraStreams
from systems.vision.people.people_follower import Mind, PeopleFollower
from systems.vision.people.shared_watch import SharedWatch
from systems.vision.people.watch_diary import WatchDiary
from systems.vision.people.watch_process import Lookout, WatchProcess

DRAWN = "drawn"  # in place of the address of video streams
OF_WATCH = ("speed_share", "stop", "separation")  # ports of the monitor that are logged


@dataclass(frozen=True)
class LivePeople:
    """What the watch for people of a run has said and done."""

    times: np.ndarray  # (n,) s
    said: dict[str, np.ndarray]  # values (n, size) of `OF_WATCH` and of ``path_time``
    sets: int  # of images that were looked at
    seconds: float  # CPU time for all of them

    @classmethod
    def of(cls, watch: WatchProcess, times: np.ndarray, logged: dict[str, np.ndarray]) -> "LivePeople":
        """What a process has done, and what was logged at times (n,) in s."""
        said = {name: logged[name] for name in (*OF_WATCH, "path_time")}
        return cls(times, said, watch.shared.sets, watch.shared.seconds)

    @property
    def stops(self) -> int:
        """How often the robot was stopped, the start apart."""
        return int(np.count_nonzero(np.diff((self.said["stop"][:, 0] > 0.5).astype(int)) > 0))

    @property
    def largest_age(self) -> float:
        """Of the images that a decision after the first second knew, in s."""
        age = self.said["separation"][self.times > 1.0, STATUS.index("age")]
        return float(age.max(initial=0.0))


class StopEvents:
    """What a run says of its stops for people, one decision of the monitor after the other."""

    def __init__(self) -> None:
        """Before the first decision: nobody has been near."""
        self._stopped = self._pressed = False

    def note(self, servo: System, root_context: Context, is_acknowledged: bool) -> list[tuple[str, str]]:
        """What has changed since the last time.

        Args:
            servo: with the ports of the monitor.
            root_context: of the diagram that it is in.
            is_acknowledged: whether somebody now lets the robot go on.

        Returns:
            Kinds and details of events.
        """
        context = servo.GetMyContextFromRoot(root_context)
        stopped = servo.GetOutputPort("stop").Eval(context)[0] > 0.5
        status = servo.GetOutputPort("separation").Eval(context)
        distance, age = status[STATUS.index("distance")], status[STATUS.index("age")]
        near = f"somebody is {distance:.2f} m away" if distance < FAR else "nobody is seen"
        why = f"{near}, images are {age:.2f} s old" if age < FAR else "no image has been trusted yet"
        found = []
        if stopped and not self._stopped:
            found.append(("stopped_for_people", why))
        if is_acknowledged and not self._pressed and self._stopped:
            found.append(("acknowledged", why))
        if self._stopped and not stopped:
            found.append(("goes_on", why))
        self._stopped, self._pressed = stopped, is_acknowledged
        return found


@dataclass(frozen=True)
class LiveWatch:
    """The system that decides, for a diagram, and how the process that looks is started."""

    monitor: SeparationMonitor
    start: Callable[[], WatchProcess]


def live_watch(scenario: Scenario, robot: RobotModel) -> LiveWatch | None:
    """The watch of a real station, of which nothing has been started yet; None if it has no whole images.

    Args:
        scenario: with `station.overview` and its source.
        robot: that stands in the cell.

    Raises:
        ValueError: if a part refuses its configuration.
    """
    if not scenario.station.overview.enabled:
        return None
    believed = controller_model(scenario, robot).robot
    monitor = separation_monitor(scenario, believed, scenario.station.period)
    return LiveWatch(monitor, partial(WatchProcess, partial(lookout, scenario, robot)))


def lookout(scenario: Scenario, robot: RobotModel, shared: SharedWatch) -> Lookout:
    """What looks for people in the process.

    Drawn images know the empty cell; with streams it is learnt from the first images, while the robot goes to
    the start of its path.

    Args:
        scenario, robot: as of `live_watch`.
        shared: where the joints are found.

    Raises:
        ValueError: if a file is missing or wrong, or a stream cannot be opened.
    """
    overview, config = scenario.station.overview, scenario.servo.people
    if overview.source != DRAWN:
        watched = watched_cell(scenario, robot, Blind())
        names = [camera.name for camera in load_cell(overview.cell).cameras]
        source = CameraStreams(
            overview.source, names, watched.size, overview.period, overview.delay, steady_time
        )
        follower = PeopleFollower(watched.detector, config.tracks, config.lasting)
        return Lookout(follower, source, diary=WatchDiary(watched.detector.arm))
    bare = watched_cell(scenario, robot, Blind())
    pictures = FlatPictures(bare.detector.cameras, bare.size)
    watched = replace(bare, pictures=pictures)
    believed = controller_model(scenario, robot).robot
    joints = joints_along(scenario, believed, make_path(scenario.reference))[1]
    memory = watched.detector.learn(*empty_cell(scenario, watched, joints))
    drawn = DrawnImages(overview, pictures, watched.detector.arm, watched.people, shared, steady_time)
    follower = PeopleFollower(watched.detector, config.tracks, config.lasting)
    return Lookout(follower, drawn, Mind(memory), WatchDiary(watched.detector.arm))


class Blind:
    """Draws nothing: real cameras take the pictures."""

    def take(self, robot: Capsules, people: Sequence[Capsules | None]) -> np.ndarray:
        """No images."""
        return np.zeros((0, 0, 0, 3), np.uint8)


def people_at(watch: WatchProcess | None, time: float, arrived: float) -> PersonSample:
    """The newest people on the path's clock, which showed ``time`` at the steady time ``arrived``; s."""
    if watch is None:
        return PersonSample()
    found = watch.shared.people()
    return replace(found, time=time + found.time - arrived)
