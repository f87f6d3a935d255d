"""What tests of people share: the cell with small images, and pictures painted without a renderer."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from robots.description.model import load_robot
from robots.kinematics.arm_capsules import Capsules
from systems.cell.overview.person import figure
from systems.vision.camera_model import Cameras
from systems.vision.camera_rig import load_cell
from systems.vision.people.people_detector import DetectorConfig, PeopleDetector, reduced
from systems.vision.people.silhouettes import silhouettes
from systems.vision.people.surroundings import load_surroundings
from systems.vision.people.visual_hull import HullConfig

ROBOT = load_robot("irb1200")
SURROUNDINGS = load_surroundings("probst")
CELL = load_cell("probst")
CAMERAS, SIZE = reduced(CELL.camera_model(ROBOT.base.pose()), CELL.sensor_px, 320)
CONFIG = DetectorConfig(hull=HullConfig(edge=0.08))
ARMS = [np.array([turn, 0.4, -0.2, 0.0, 0.6, 0.0]) for turn in (-1.4, 0.0, 1.4)]


@cache
def detector() -> PeopleDetector:
    return PeopleDetector(ROBOT, CAMERAS, SIZE, SURROUNDINGS, CONFIG)


class Painted:
    """Pictures of a mottled cell with the robot and people painted in front of everything."""

    def __init__(self, cameras: Cameras = CAMERAS, size: tuple[int, int] = SIZE) -> None:
        self._cameras, self._size = cameras, size
        width, height = size
        mottled = np.random.default_rng(7).uniform(60, 140, (len(cameras), height, width, 3))
        self._empty = mottled.astype(np.uint8)

    def take(self, robot: Capsules, people: Sequence[Capsules | None]) -> np.ndarray:
        images = self._empty.copy()
        images[silhouettes(self._cameras, robot, self._size) > 0] = (20, 120, 230)
        for person in people:
            if person is not None:
                images[silhouettes(self._cameras, person, self._size) > 0] = (170, 60, 30)
        return images


def painted(
    capsules: Capsules | None, q: np.ndarray, rng: np.random.Generator, gain: float = 1.0
) -> np.ndarray:
    """Painted images at joint positions q, with noise of 3/255."""
    images = gain * Painted().take(detector().arm.at(q), [capsules]).astype(np.float32)
    images += 3.0 * rng.standard_normal(images.shape, dtype=np.float32)
    return np.clip(np.rint(images), 0, 255).astype(np.uint8)


def person_at(x: float, y: float) -> Capsules:
    return figure(np.array([x, y]), 0.3, SURROUNDINGS.floor)
