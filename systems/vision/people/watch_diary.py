"""What a watch has seen, for its report: where the nearest person was, and the images that show it best."""

from array import array
from dataclasses import dataclass

import numpy as np

from robots.kinematics.arm_capsules import ArmCapsules
from systems.samples import ImageSample
from systems.vision.people.lasting_changes import LastingChange
from systems.vision.people.people_follower import Mind
from systems.vision.people.visual_hull import Body

_COLUMNS = 5  # time, distance, place along x and y, whether the images are trusted


@dataclass(frozen=True)
class Snapshot:
    """The images in which somebody was nearest."""

    time: float  # s
    images: np.ndarray  # (n, h, w, 3) of uint8
    bodies: list[Body]
    q: np.ndarray  # joints in them in rad, (6,)


@dataclass(frozen=True)
class Seen:
    """Everything that a watch has seen, in n sets of images; NaN where nobody was there."""

    time: np.ndarray  # of the exposures in s, (n,)
    distance: np.ndarray  # of the nearest person from the robot in m, (n,)
    place: np.ndarray  # of its middle, x and y in the world in m, (n, 2)
    trusted: np.ndarray  # bool, (n,)
    nearest: Snapshot | None
    changes: tuple[LastingChange, ...]  # of the cell, that have stayed


class WatchDiary:
    """Notes set after set of images; of the images themselves it keeps one set."""

    def __init__(self, arm: ArmCapsules) -> None:
        """``arm`` is the robot, from which distances count."""
        self._arm = arm
        self._rows = array("d")
        self._nearest, self._least = None, np.inf
        self._changes: tuple[LastingChange, ...] = ()

    def note(self, mind: Mind, images: ImageSample, q: np.ndarray) -> None:
        """Takes what is known after a set of images, in which the joints stood at q (6,) in rad."""
        arm, people = self._arm.at(q), mind.sample.people
        gaps = [float(arm.distances(each.points).min()) - each.reach for each in people]
        distance, place = np.nan, (np.nan, np.nan)
        if gaps:
            distance = min(gaps)
            place = people[gaps.index(distance)].points.mean(axis=0)[:2]
            if distance <= self._least:
                bodies = [each.body for each in mind.standing]
                self._least, self._nearest = distance, Snapshot(images.time, images.images, bodies, q)
        self._rows.extend([images.time, distance, *place, float(mind.sample.trusted)])
        self._changes = mind.changes

    def seen(self) -> Seen:
        """Everything so far."""
        rows = np.array(self._rows).reshape(-1, _COLUMNS)
        trusted = rows[:, 4] > 0.5
        return Seen(rows[:, 0], rows[:, 1], rows[:, 2:4], trusted, self._nearest, self._changes)
