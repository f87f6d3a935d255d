"""The marker cameras with their whole images: at a low rate and a reduced size, late and noisy."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.common.value import Value
from pydrake.systems.framework import Context, State

from robots.configuration.quantity import file_name, numbers, quantity
from robots.description.model import NUM_JOINTS
from robots.kinematics.arm_capsules import ArmCapsules, Capsules
from systems.cell.overview.person import PersonConfig, WalkingPerson
from systems.sampled_system import SampledSystem
from systems.samples import ImageSample

_FULL_SCALE = 255
_EPSILON = 1e-9  # s, a sample that is due at a tick arrives at it in spite of rounding


@dataclass
class LightConfig:
    """How light and sensors change images; read from a scenario file."""

    noise: float = quantity(3.0, 0.0, 100.0)  # of 255, standard deviation of a colour of a pixel
    swing: float = quantity(0.0, 0.0, 0.9)  # share by which the light swings up and down
    swing_period: float = quantity(60.0, 0.0, unit="s", is_open=True)  # of one swing up and down
    step: float = quantity(0.0, -0.9, 10.0)  # share by which it changes at ``step_at``
    step_at: float = quantity(0.0, unit="s")  # since the start of the run

    def gain(self, time: float) -> float:
        """The brightness at a time in s; 1 as it was when the empty cell was learnt."""
        swing = 1.0 + self.swing * np.sin(2.0 * np.pi * time / self.swing_period)
        return float(swing * (1.0 + (self.step if time >= self.step_at and self.step else 0.0)))


@dataclass
class OverviewConfig:
    """Whole images of the cameras of a cell, and who walks through it; read from a scenario file."""

    enabled: bool = False  # whether the station has them and the robot is slowed for people
    cell: str = file_name("probst")  # the cameras, a shipped cell or a file
    surroundings: str = file_name("probst")  # what stands still about the robot, likewise
    people: list[PersonConfig] = field(default_factory=list)  # who walks through the cell
    width: int = quantity(640, 64, 8192, "px")  # of a whole image
    period: float = quantity(0.05, 1e-3, 10.0, "s")  # between two sets of images
    delay: float = quantity(0.03, 0.0, 1.0, "s")  # from exposure to arrival
    # Of a real station: address of the video of a camera, {camera} for its name; drawn for a virtual cell
    source: str = ""
    losses: list[float] = numbers((), unit="s")  # begin and end of one time after the other without images
    light: LightConfig = field(default_factory=LightConfig)


def recorded(images: np.ndarray, time: float, light: LightConfig, key: np.ndarray) -> np.ndarray:
    """Images as the sensors record them: under the light of a time in s, with noise.

    Args:
        images: (n, h, w, 3) of uint8.
        time: s.
        light: what changes them.
        key: two standard normal numbers; the same ones give the same noise.
    """
    rng = np.random.Generator(np.random.Philox(key=np.ascontiguousarray(key, float).view(np.uint64)))
    value = light.gain(time) * images.astype(np.float32)
    if light.noise:
        value += light.noise * rng.standard_normal(images.shape, dtype=np.float32)
    return np.clip(np.rint(value, out=value), 0, _FULL_SCALE, out=value).astype(np.uint8)


class Pictures(Protocol):
    """What draws a set of images, `CellPictures` for example."""

    def take(self, robot: Capsules, people: Sequence[Capsules | None]) -> np.ndarray:
        """Images (n, h, w, 3) of uint8 of a robot and people where they are."""
        ...


class OverviewCamera(SampledSystem):
    """Takes whole images of a simulated cell.

    Ports:
        in  ``motor_state``   vector 12, positions (rad) and velocities (rad/s) of the true robot's motors
        in  ``noise``         vector 2, standard normal
        out ``image_sample``  ImageSample, the newest that has arrived; without images before the first
    """

    def __init__(
        self,
        config: OverviewConfig,
        pictures: Pictures,
        arm: ArmCapsules,
        people: Sequence[WalkingPerson] = (),
    ) -> None:
        """Makes the system.

        Args:
            config: when images are taken and how.
            pictures: what draws them, with as many figures as there are people.
            arm: the capsules of the true robot.
            people: who walks through the cell.
        """
        super().__init__()
        self._config, self._pictures, self._arm, self._people = config, pictures, arm, list(people)
        self._motors = self.DeclareVectorInputPort("motor_state", 2 * NUM_JOINTS)
        self._noise = self.DeclareVectorInputPort("noise", 2, RandomDistribution.kGaussian)
        self._in_flight = self.DeclareAbstractState(Value[object](()))
        self.DeclareAbstractOutputPort(
            "image_sample",
            lambda: Value[object](ImageSample()),
            self._calc_sample,
            {self.time_ticket(), self.abstract_state_ticket(self._in_flight)},
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(config.period, 0.0, self._expose)

    def _expose(self, context: Context, state: State) -> None:
        time = context.get_time()
        pairs = zip(self._config.losses[::2], self._config.losses[1::2], strict=True)
        if any(begin <= time < end for begin, end in pairs):
            return
        robot = self._arm.at(self._motors.Eval(context)[:NUM_JOINTS])
        drawn = self._pictures.take(robot, [person.at(time) for person in self._people])
        images = recorded(drawn, time, self._config.light, self._noise.Eval(context))
        kept = int(np.ceil(self._config.delay / self._config.period)) + 1
        before = context.get_abstract_state(int(self._in_flight)).get_value()
        now = (ImageSample(time, images), *before)[: kept + 1]
        state.get_mutable_abstract_state(int(self._in_flight)).set_value(now)

    def _calc_sample(self, context: Context, output) -> None:
        due = context.get_time() - self._config.delay + _EPSILON
        arrived = (
            each for each in context.get_abstract_state(int(self._in_flight)).get_value() if each.time <= due
        )
        output.set_value(next(arrived, ImageSample()))
