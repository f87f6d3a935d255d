"""Whole images of a virtual cell in real time: flat pictures of people and of the robot as it reports."""

from collections.abc import Callable, Sequence

import numpy as np

from robots.kinematics.arm_capsules import ArmCapsules, Capsules
from systems.cell.overview.overview_camera import OverviewConfig, recorded
from systems.cell.overview.person import WalkingPerson
from systems.samples import ImageSample
from systems.vision.camera_model import Cameras
from systems.vision.people.shared_watch import SharedWatch
from systems.vision.people.silhouettes import silhouettes

_ROBOT, _CLOTHES, _MOTTLED = (20, 120, 230), (170, 60, 30), (60, 140)  # of 255


class FlatPictures:
    """Silhouettes before a mottled cell. People hide the robot and furniture hides nobody.

    Takes 20 to 40 ms for ten images where a renderer without a graphics card takes a second.
    """

    def __init__(self, cameras: Cameras, size: tuple[int, int]) -> None:
        """``cameras`` are those of the images, which have ``size`` (width, height) in px."""
        self._cameras, self._size = cameras, size
        shape = (len(cameras), size[1], size[0], 3)
        self._empty = np.random.default_rng(7).integers(*_MOTTLED, shape, dtype=np.uint8)

    def take(self, robot: Capsules, people: Sequence[Capsules | None]) -> np.ndarray:
        """Images (n, h, w, 3) of uint8 of a robot and people where they are."""
        images = self._empty.copy()
        images[silhouettes(self._cameras, robot, self._size) > 0] = _ROBOT
        for person in people:
            if person is not None:
                images[silhouettes(self._cameras, person, self._size) > 0] = _CLOTHES
        return images


class DrawnImages:
    """Draws the robot where it says that it is, and people where they are since the path began."""

    def __init__(
        self,
        config: OverviewConfig,
        pictures: FlatPictures,
        arm: ArmCapsules,
        people: Sequence[WalkingPerson],
        shared: SharedWatch,
        now: Callable[[], float],
    ) -> None:
        """Makes the source.

        Args:
            config: how often images are taken, and how.
            pictures: what draws them.
            arm: the capsules of the robot.
            people: who walks through the cell once the path runs.
            shared: where the joints are found.
            now: the steady clock in s.
        """
        self._config, self._pictures, self._arm, self._people = config, pictures, arm, list(people)
        self._shared, self._now, self._given, self._number = shared, now, -np.inf, 0

    def newest(self) -> ImageSample | None:
        """A set of images once a period; None before it is over, and before the robot says where it is."""
        heard = self._shared.newest_joints()
        if heard is None or self._now() < self._given + self._config.period:
            return None
        self._given = self._now()
        origin = self._shared.origin
        since = heard[0] - origin
        people = [person.at(since) if origin else None for person in self._people]
        drawn = self._pictures.take(self._arm.at(heard[1]), people)
        self._number += 1
        key = np.array([self._number, -3.0])
        return ImageSample(heard[0], recorded(drawn, since if origin else 0.0, self._config.light, key))

    def close(self) -> None:
        """Nothing is open."""
