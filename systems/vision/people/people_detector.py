"""From one set of images and the joints of the robot to bodies in the cell."""

from dataclasses import dataclass, field, replace

import numpy as np

from robots.configuration.quantity import quantity
from robots.description.model import RobotModel
from robots.kinematics.arm_capsules import ArmCapsules, ToolShape
from systems.vision.camera_model import Cameras
from systems.vision.people.background import (
    BackgroundConfig,
    Memory,
    Pixels,
    adapted,
    compare,
    remembered,
)
from systems.vision.people.person_tracks import TrackConfig
from systems.vision.people.silhouettes import silhouettes
from systems.vision.people.surroundings import Surroundings
from systems.vision.people.visual_hull import Body, HullConfig, VisualHull


@dataclass
class DetectorConfig:
    """How people are looked for; read from a scenario file."""

    computation: float = quantity(0.05, 1e-3, 1.0, "s")  # from the arrival of images to the result
    background: BackgroundConfig = field(default_factory=BackgroundConfig)
    hull: HullConfig = field(default_factory=HullConfig)
    tracks: TrackConfig = field(default_factory=TrackConfig)
    lasting: float = quantity(
        5.0, 0.1, 3600.0, "s"
    )  # at one place, after which a body is a change of the cell
    robot_margin: float = quantity(0.04, 0.0, 0.5, "m")  # about the robot, in which pixels are unknown
    least_trusted: int = quantity(4, 2, 100)  # cameras; with fewer, nobody can be told to be absent
    tool_length: float = quantity(0.35, 0.0, 5.0, "m")  # of what the flange carries; a marker body, assumed
    # Of what the flange carries, about the axis of the last joint
    tool_radius: float = quantity(0.06, 0.0, 2.0, "m", is_open=True)


@dataclass(frozen=True)
class Detection:
    """What one set of images shows."""

    bodies: list[Body]  # the largest first
    trusted: bool  # whether the images tell that nobody else is there
    pixels: list[Pixels]  # of each camera


def watched_arm(robot: RobotModel, config: DetectorConfig) -> ArmCapsules:
    """The robot with what its flange carries."""
    tool = ToolShape(config.tool_length, config.tool_radius) if config.tool_length else None
    return ArmCapsules(robot, tool)


def reduced(cameras: Cameras, sensor_px: np.ndarray, width: int) -> tuple[Cameras, tuple[int, int]]:
    """Cameras whose whole images are made so wide, and the size of these in px."""
    share = width / float(sensor_px[0])
    size = (width, round(float(sensor_px[1]) * share))
    # The middle of the first pixel is half a pixel from the edge, before and after.
    center = (cameras.center + 0.5) * share - 0.5
    return replace(cameras, focal=cameras.focal * share, center=center), size


class PeopleDetector:
    """Compares images with the empty cell and carves the hull of what is new."""

    def __init__(
        self,
        robot: RobotModel,
        cameras: Cameras,
        size: tuple[int, int],
        surroundings: Surroundings,
        config: DetectorConfig,
    ) -> None:
        """``cameras`` are those of the images, which have ``size`` (width, height) in px."""
        self._config, self.cameras, self._size = config, cameras, size
        self.arm = watched_arm(robot, config)
        self._hull = VisualHull(cameras, size, surroundings, config.hull)

    @property
    def edge(self) -> float:
        """Of the cubes of the hull in m."""
        return self._config.hull.edge

    def masks(self, q: np.ndarray) -> np.ndarray:
        """Where the robot is seen at joint positions (6,) in rad, with its margin, (n, height, width)."""
        return silhouettes(self.cameras, self.arm.at(q), self._size, self._config.robot_margin)

    def learn(self, images: list[np.ndarray], joints: list[np.ndarray]) -> Memory:
        """What the empty cell looks like, from sets of images and where the robot was."""
        return remembered(images, [self.masks(q) for q in joints])

    def detect(self, memory: Memory, images: np.ndarray, q: np.ndarray) -> tuple[Detection, Memory]:
        """Bodies in a set of images.

        Args:
            memory: of the empty cell.
            images: (n, height, width, 3) of uint8.
            q: where the joints were at the exposure in rad, (6,).

        Returns:
            What is seen, and the memory after it.

        Raises:
            ValueError: if the images have another number or size.
        """
        width, height = self._size
        expected = (len(self.cameras), height, width, 3)
        if images.shape != expected:
            raise ValueError(
                f"images must be {expected[0]} of {width} x {height} px in three colours, got {images.shape}"
            )
        masks = self.masks(q)
        config = self._config.background
        pixels = [compare(memory, i, images[i], masks[i], config) for i in range(len(images))]
        trusted = sum(each.trusted for each in pixels) >= self._config.least_trusted
        bodies = self._hull.bodies(pixels) if trusted else []
        return Detection(bodies, trusted, pixels), adapted(memory, images, pixels, config)
