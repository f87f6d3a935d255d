"""Rectangles that a robot drives under the inverse model of a belief, and what a camera sees of its tip."""

from dataclasses import dataclass, replace

import numpy as np

from diagrams.record.log import RunLog
from diagrams.runs.simulation import run
from diagrams.scenario.scenario import Scenario
from experiments.cli.workers import Progress, SimulationError
from experiments.feedforward.rectangle import (
    LAW,
    RectangleTrial,
    feasible_pace,
    rectangle,
    rectangle_scenario,
    working_position,
)
from robots.description.model import NUM_JOINTS, RobotModel
from systems.feedforward import FeedforwardConfig
from systems.reference.shapes import Rectangle

_KIND = "elastic_structure"  # of the inverse model
_SETTLE = 0.8  # s at rest: the arm is first wound up
_SEEN = 0.5  # share of a motion that the camera has to see
_EDGES = 4


@dataclass(frozen=True)
class Shape:
    """Where a rectangle is, how large and how fast."""

    name: str
    size: float  # share of the rectangle of `truetip feedforward`
    pace: float  # 1/s^2, k_a, where joints are quick enough for it
    turned_deg: tuple[float, ...] = (0.0,) * NUM_JOINTS  # of the joints, from that one's place


TUNED = Shape("tuned", 0.5, 25.0)
VALIDATED = Shape("validated", 0.7, 8.0, (25.0, -10.0, 10.0, 0.0, 0.0, 0.0))


@dataclass(frozen=True)
class TipMotion:
    """Deviations of the tip from its path at n instants, by the stamps of the camera; 0 s is its start."""

    time: np.ndarray  # (n,) s, below zero at rest before it
    measured: np.ndarray  # (n, 3) m, NaN where the camera saw nothing
    true: np.ndarray  # (n, 3) m, for the report alone
    end: float  # s, of the path; then the robot stays

    @property
    def seen(self) -> np.ndarray:
        """Which instants count: on the path or after it, and measured; (n,) bool."""
        return (self.time >= 0.0) & np.isfinite(self.measured).all(axis=1)

    @property
    def parts(self) -> np.ndarray:
        """On which edge an instant is, or behind the last one: 0 to 4, (n,)."""
        return np.clip(np.floor(_EDGES * self.time / self.end), 0, _EDGES).astype(int)

    @property
    def deviation(self) -> "Size":
        """On the path and after it."""
        return Size.of(self, self.time >= 0.0)

    @property
    def ringing(self) -> "Size":
        """Of how the tip moves about its mean place after the end."""
        return Size.of(self, self.time > self.end, about_mean=True)


@dataclass(frozen=True)
class Size:
    """Root mean square of a deviation in m."""

    measured: float
    true: float

    @staticmethod
    def of(motion: TipMotion, chosen: np.ndarray, about_mean: bool = False) -> "Size":
        """At chosen instants (n,) of a motion; about its mean, or as it is.

        The measured one is from products of one measurement with the next: noise, which is another one in
        each of them, does not add to their mean.
        """
        gaps = motion.measured[chosen], motion.true[chosen]
        if about_mean:
            gaps = tuple(gap - np.nanmean(gap, axis=0) for gap in gaps)
        measured, true = gaps
        with_next = np.nanmean(np.sum(measured[1:] * measured[:-1], axis=1))
        return Size(float(np.sqrt(max(with_next, 0.0))), float(np.sqrt(np.mean(np.sum(true**2, axis=1)))))


@dataclass(frozen=True)
class TipRun:
    """A rectangle that a robot drives once."""

    belief: RobotModel  # of the inverse model
    plant: RobotModel  # what is driven
    payload: float  # kg
    shape: Shape
    seed: int  # of the camera's noise

    def run(self, progress: Progress | None = None) -> TipMotion:
        """Simulates it, with the drives of the station and an elastic structure.

        Raises:
            ValueError: if the robot cannot follow the rectangle.
            SimulationError: if it did not get to the end, or the camera saw too little of it.
        """
        try:
            log = run(self.scenario(), LAW, self.belief, self.seed, progress, self.plant)
        except RuntimeError as error:
            raise self._failed(" ".join(str(error).split())) from error
        return self._motion(log)

    def scenario(self) -> Scenario:
        """What is driven."""
        trial = RectangleTrial(self.belief, self.payload, FeedforwardConfig(_KIND, rough_path="accept"))
        scenario = rectangle_scenario(trial)
        robot, shape = self.belief, self.shape
        home = working_position(robot) + np.deg2rad(shape.turned_deg)
        home = np.clip(home, robot.lower, robot.upper)
        path = Rectangle(rectangle(robot, home, shape.size))
        reference = replace(scenario.reference, path=path, acceleration=shape.pace, settle=_SETTLE)
        pace = feasible_pace(robot, home, reference)
        return replace(scenario, home_deg=np.rad2deg(home), reference=replace(reference, acceleration=pace))

    def _motion(self, log: RunLog) -> TipMotion:
        wanted = log.X_WE_desired[:, :3, 3]
        measured, true = log.X_WE_measured[:, :3, 3] - wanted, log.X_WE_true[:, :3, 3] - wanted
        motion = TipMotion(log.time - log.path_start, measured, true, log.dwell_start - log.path_start)
        if not np.isfinite(true).all() or log.time[-1] < log.dwell_start:
            raise self._failed("the robot did not get to its end")
        share = np.count_nonzero(motion.seen) / np.count_nonzero(motion.time >= 0.0)
        if share < _SEEN:
            raise self._failed(f"the camera saw the tool in {share:.0%} of it alone")
        return motion

    def _failed(self, why: str) -> SimulationError:
        return SimulationError(f"fine tuning, {self.shape.name} motion: {why}")


def driven(job: TipRun, progress: Progress) -> TipMotion:
    """Does a job of an `Executor`."""
    return job.run(progress)
