"""People are looked for in a process of its own, so that no control cycle waits for it."""

import contextlib
import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Protocol

import cv2
import numpy as np

from systems.samples import ImageSample
from systems.vision.people.people_follower import Mind, PeopleFollower
from systems.vision.people.shared_watch import SharedWatch
from systems.vision.people.watch_diary import Seen, WatchDiary

_NICE = 5  # what answers a controller comes first
_PAUSE = 2e-3  # s between two looks for new images
_NEAR = 0.02  # s, between an exposure and the joints that are taken for it
_ENDING = 2.0  # s, that a process has to end by itself
_MOST_LEARNT = 8  # sets of images of the empty cell
_APART = 0.2  # s between these, at least


class ImageSource(Protocol):
    """Where whole images of all cameras come from, video streams for example."""

    def newest(self) -> ImageSample | None:
        """The newest set, its time of the steady clock; None if it is none that was not given before."""
        ...

    def close(self) -> None:
        """Ends what takes images."""
        ...


@dataclass(frozen=True)
class Lookout:
    """What a process looks with."""

    follower: PeopleFollower
    source: ImageSource
    mind: Mind | None = None  # with the empty cell; None to learn it from the first images
    diary: WatchDiary | None = None  # for whom a report is wanted


Make = Callable[[SharedWatch], Lookout]


class WatchProcess:
    """The process, from its start to its end; it does not outlive the one that has started it."""

    def __init__(self, make: Make) -> None:
        """Starts it.

        Args:
            make: makes what it looks with, in the new process; it can be pickled.
        """
        self.shared = SharedWatch()
        self.seen: Seen | None = None  # everything, once it has ended, where a diary was kept
        context = get_context("spawn")
        self._receiver, sender = context.Pipe(duplex=False)
        self._process: SpawnProcess = context.Process(
            target=_watch, args=(make, self.shared, sender), name="people watch", daemon=True
        )
        self._process.start()
        sender.close()

    @property
    def pid(self) -> int | None:
        """Of the process, as the system numbers it."""
        return self._process.pid

    @property
    def is_ready(self) -> bool:
        """Whether images come and people would be seen."""
        return self.shared.is_ready

    @property
    def problem(self) -> str:
        """Why nobody looks for people any more; empty as long as somebody does."""
        if self.shared.problem or self._process.is_alive():
            return self.shared.problem
        return f"the process ended with code {self._process.exitcode}"

    def end(self) -> None:
        """Ends the process; it is gone when this returns."""
        self.shared.end()
        with contextlib.suppress(EOFError, OSError):  # it has nothing to say, or is gone
            if self._receiver.poll(_ENDING):
                self.seen = self._receiver.recv()
        self._receiver.close()
        self._process.join(_ENDING)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _watch(make: Make, shared: SharedWatch, sender: Connection) -> None:
    """The whole life of the process."""
    # Ctrl-C is for the one that has started it, which ends it when the robot stands.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.nice(_NICE)
    cv2.setNumThreads(1)
    try:
        lookout = make(shared)
    except (ValueError, OSError) as error:
        shared.say(str(error))
        raise SystemExit(1) from None
    try:
        look_until_ended(lookout, shared)
    except (ValueError, OSError) as error:
        shared.say(str(error))
        raise SystemExit(1) from None
    finally:
        if lookout.diary is not None:
            with contextlib.suppress(OSError):  # nobody listens any more
                sender.send(lookout.diary.seen())
        lookout.source.close()


def look_until_ended(lookout: Lookout, shared: SharedWatch) -> None:
    """Looks at the newest images, one set after the other, as long as somebody reads.

    Args:
        lookout: what to look with.
        shared: where joints are found and people are left.

    Raises:
        ValueError: if images have another number or size than the cameras.
    """
    parent, mind = parent_process(), lookout.mind
    learnt: list[ImageSample] = []
    places: list[np.ndarray] = []
    while not shared.is_ended and (parent is None or parent.is_alive()):
        images = lookout.source.newest()
        q = None if images is None else shared.joints_at(images.time, _NEAR)
        if images is None or q is None:
            time.sleep(_PAUSE)
            continue
        if lookout.mind is None and (shared.is_learning or mind is None):
            is_due = not learnt or images.time - learnt[-1].time >= _APART
            if is_due and len(learnt) < _MOST_LEARNT:
                learnt.append(images)
                places.append(q)
                mind = Mind(lookout.follower.detector.learn([each.images for each in learnt], places))
        began = time.process_time()
        assert mind is not None
        mind = lookout.follower.after(mind, images, q)
        shared.publish(mind.sample, time.process_time() - began)
        if lookout.diary is not None:
            lookout.diary.note(mind, images, q)
