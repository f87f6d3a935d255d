"""A virtual cell as its cameras show it, drawn in a process of its own beside the one that keeps its time."""

import contextlib
import os
import signal
import time
from multiprocessing import get_context, parent_process

import cv2

from diagrams.live_watch import Blind
from diagrams.scenario.scenario import Scenario
from diagrams.watching import watched_cell
from robots.description.model import RobotModel
from systems.cell.overview.drawn_images import DrawnImages, FlatPictures
from systems.cell.overview.image_server import ImageServer
from systems.link.clock import steady_time
from systems.vision.camera_rig import load_cell
from systems.vision.people.shared_watch import SharedWatch

_NICE = 5
_PAUSE = 2e-3  # s between two looks whether images are due
_EMPTY = 20.0  # s, for which nobody comes after all cameras are looked at: who watches learns the empty cell
_LONGEST_START, _ENDING = 60.0, 3.0  # s


class ShownCell:
    """The process; it ends with the one that has started it. `note_joints` says where the robot is."""

    def __init__(self, scenario: Scenario, robot: RobotModel, port: int) -> None:
        """Starts it, and waits until it shows something.

        Args:
            scenario: with `station.overview` and who walks through the cell.
            robot: that stands in it.
            port: of this machine, 0 for any free one.

        Raises:
            OSError: if it cannot listen there.
            ValueError: if a part refuses its configuration.
        """
        self._shared = SharedWatch()
        self.note_joints = self._shared.note_joints
        context = get_context("spawn")
        receiver, sender = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_show, args=(scenario, robot, port, self._shared, sender), name="cameras", daemon=True
        )
        self._process.start()
        sender.close()
        with receiver:
            try:
                found = receiver.recv() if receiver.poll(_LONGEST_START) else "it did not begin"
            except EOFError:
                found = "its process ended"
        if isinstance(found, str):
            self.close()
            raise ValueError(f"the cameras cannot be shown: {found}")
        self.port: int = found

    def close(self) -> None:
        """Ends the process."""
        self._shared.end()
        self._process.join(_ENDING)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _show(scenario: Scenario, robot: RobotModel, port: int, shared: SharedWatch, sender) -> None:
    """The whole life of the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.nice(_NICE)
    cv2.setNumThreads(1)
    overview = scenario.station.overview
    try:
        cell = watched_cell(scenario, robot, Blind())
        pictures = FlatPictures(cell.detector.cameras, cell.size)
        names = [camera.name for camera in load_cell(overview.cell).cameras]
        server = ImageServer(names, port)
    except (ValueError, OSError) as error:
        sender.send(str(error))
        return
    sender.send(server.port)
    drawn = DrawnImages(overview, pictures, cell.detector.arm, cell.people, shared, steady_time)
    parent, seen_since = parent_process(), None
    while not shared.is_ended and (parent is None or parent.is_alive()):
        images = drawn.newest()
        if images is None:
            time.sleep(_PAUSE)
            continue
        time.sleep(max(0.0, images.time + overview.delay - steady_time()))
        server.publish(images.images)
        now = steady_time()
        if seen_since is None and server.are_all_seen:
            seen_since = now
        if seen_since is not None and shared.is_learning and now > seen_since + _EMPTY:
            shared.begin_path(now)
    server.close()
