"""Mixtures: each seed draws a type of robot and, of all that may differ from cell to cell, a value of each.

Nobody chooses what comes together. All of it is in the sizes that cells have; of some dead times and loads no
controller is told.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

T = TypeVar("T")

# Without those of which the scenario would have to say more than their name
ROBOTS = (
    "irb1200",
    "irb140",
    "ur10",
    "crb15000",
    "crx10ial",
    "mh5",
    "tx2_90",
    "kr16",
    "kr210",
    "puma560",
)
_LOAD, _MODEL = "station.payload", "servo.model.payload"
# Where a robot of 2.7 m is off by half as much again as others, its tip is beyond the 0.1 m of the guard
_OF_LARGE_ROBOTS = "servo.laws.self_calibrating.correction_limit=0.3"


@dataclass(frozen=True)
class Mixture:
    """What a seed has drawn."""

    robot: str | None = None  # None for the scenario's
    settings: tuple[str, ...] = ()  # of the scenario, as ``--set`` takes them


def mixture(seed: int) -> Mixture:
    """What a seed draws, always the same."""
    draw = _Draw(seed)
    robot = draw.one_of(*ROBOTS)
    parts = _timing, _camera, _robot, _drives, _load, _path
    settings = [setting for part in parts for setting in part(draw)]
    return Mixture(robot, (*settings, *[_OF_LARGE_ROBOTS] * (robot == "kr210")))


class _Draw:
    """Random numbers of a seed, which are not those of its robot's errors."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng([seed, 1])

    def one_of(self, *values: T) -> T:
        return values[int(self._random.integers(len(values)))]

    def happens(self, probability: float) -> bool:
        return bool(self._random.random() < probability)


def _timing(draw: _Draw) -> Iterator[str]:
    """The tick, the interface, and a dead time of which the controller knows or does not."""
    period = draw.one_of(2e-3, 4e-3, 4e-3, 4.032e-3, 8e-3)
    dead_time = draw.one_of(3e-3, 3e-3, 0.02, 0.06, 0.139, 0.2)
    is_told = draw.happens(0.6)
    yield f"station.period={period}"
    yield f"station.drive.command_delay={period}"
    yield f"reference.preview={period}"
    yield f"station.drive.dead_time={dead_time}"
    yield f"servo.model.command_delay={period + dead_time - 3e-3 if is_told else period:.6g}"
    if draw.happens(0.25):
        yield "station.interface=egm"


def _camera(draw: _Draw) -> Iterator[str]:
    """Its rate, its lateness, its clock, its noise, and what it does not see."""
    noise = draw.one_of(0.3, 1.0, 1.0, 2.0)
    yield f"station.camera.period={draw.one_of(4e-3, 4e-3, 8e-3, 0.01, 0.0167, 0.0333)}"
    yield f"station.camera.delay={draw.one_of(4e-3, 4e-3, 0.012, 0.03, 0.06)}"
    yield f"station.camera.clock_offset={draw.one_of(-3e-3, 0.0, 0.01, -0.02)}"
    yield f"station.camera.position_sigma={5e-5 * noise:.3g}"
    yield f"station.camera.orientation_sigma_deg={0.01 * noise:.3g}"
    if draw.happens(0.2):
        yield "station.camera.dropout_probability=0.1"
    if draw.happens(0.15):
        yield "station.camera.dropouts=[[5, 5.5]]"
    if draw.happens(0.2):
        yield "station.camera.outlier_probability=0.05"
    if draw.happens(0.1):
        yield "station.camera.clock_drift_ppm=100"


def _robot(draw: _Draw) -> Iterator[str]:
    """How far it is from its file."""
    size = draw.one_of(0.3, 1.0, 1.0, 1.5)
    yield f"station.errors.random.translation_mm={6 * size:.3g}"
    yield f"station.errors.random.rotation_deg={0.9 * size:.3g}"
    yield f"station.variation.stiffness={draw.one_of(0.1, 0.2, 0.3)}"
    yield f"station.variation.friction={draw.one_of(0.1, 0.2, 0.4)}"
    yield f"station.encoder.bits={draw.one_of(17, 19, 19, 20)}"
    if draw.happens(0.2):
        yield "station.link_growth_ppm_per_hour=100"


def _drives(draw: _Draw) -> Iterator[str]:
    """Gains, which no controller is told."""
    yield f"station.drive.cascade.position={draw.one_of(15, 25, 25, 40)}"
    yield f"station.drive.cascade.velocity={draw.one_of(60, 100, 100, 150)}"
    yield f"station.drive.cascade.integral={draw.one_of(5, 10, 10, 20)}"


def _load(draw: _Draw) -> Iterator[str]:
    """What is carried, what the controller believes of it, and what the drives are told."""
    mass = draw.one_of(0.0, 3.5, 7.0, 7.0)
    yield f"{_LOAD}={mass}"
    yield f"{_MODEL}={draw.one_of(0.95, 0.95, 1.05) * mass + (0.3 if mass == 0.0 else 0.0):.4g}"
    if mass and draw.happens(0.15):
        yield "station.drive.payload=0"


def _path(draw: _Draw) -> Iterator[str]:
    """How fast it is, and how its speed changes."""
    yield f"reference.acceleration={draw.one_of(0.35, 0.7, 0.7, 1.2)}"
    yield f"reference.timing={draw.one_of('sine_squared', 'sine_squared', 'polynomial')}"
