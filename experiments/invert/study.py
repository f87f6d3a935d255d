"""Inverse models on a fast motion of an elastic robot: three know the present of the path, one all of it."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.cli.workers import Progress, SimulationError, in_processes
from experiments.feedforward.trial import Trial, commands, criterion
from experiments.invert.rehearsal import REHEARSED, Rehearsal
from robots.description.model import NUM_JOINTS, RobotModel
from robots.description.variation import Factors, varied
from systems.controller_model import ControllerModel
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig

KINDS: tuple[str, ...] = ("rigid", "flexible_joint", "elastic_structure", "stable")
FAST = 0.2  # s, from rest to the largest speed: 5 degrees take a fifth of a second or two
SETTLE = 0.35  # s at rest before the motion, for the motors that begin before it
_PERIOD = 4e-3  # s
_SHARES = (0.3, 0.7)  # of the ranges of axes 2 and 3, between which the motions begin


@dataclass(frozen=True)
class Ringing:
    """How the wrist moves after a motion; empty where the inverse refuses it."""

    times: np.ndarray  # (n,) s
    accelerations: np.ndarray  # (n, 3) m/s^2
    refused: str = ""  # why there is no motion

    @property
    def criterion(self) -> float:
        """C of (6.1) in m/s, NaN where there is no motion."""
        return criterion(self.times, self.accelerations) if len(self.times) else np.nan


@dataclass(frozen=True)
class InvertStudy:
    """Results; k poses, s robots as they may truly be."""

    robot: RobotModel
    payload: float  # kg
    angle_deg: float
    spring_error: float
    poses: np.ndarray  # (k, 6) rad
    ringing: Mapping[str, list[list[Ringing]]]  # by kind, of each true robot and pose
    rehearsed: Mapping[str, list[list[Ringing]]]  # the same with springs from a rehearsal, where one was made
    shown: int  # index of the first pose in which every inverse is there
    example: Mapping[str, np.ndarray]  # by kind, commands (n, 3, 6) at ticks from that pose
    seconds: float  # that the stable inverse takes

    def criterion(self, kind: str, is_rehearsed: bool = False) -> np.ndarray:
        """C in m/s, shape (s, k)."""
        of = self.rehearsed if is_rehearsed else self.ringing
        return np.array([[one.criterion for one in row] for row in of[kind]])

    @property
    def refusals(self) -> list[tuple[np.ndarray, str]]:
        """Where the stable inverse of the first robot was not found (rad, (6,)), and why."""
        of_first = zip(self.poses, self.ringing["stable"][0], strict=True)
        return [(pose, one.refused) for pose, one in of_first if one.refused]

    def found(self, kind: str, is_rehearsed: bool = False) -> np.ndarray:
        """C in m/s in a row, (n,), without those for which there was no stable inverse."""
        values = self.criterion(kind, is_rehearsed)
        return values[np.isfinite(values)]

    @property
    def ratio(self) -> np.ndarray:
        """C of the stable inverse over the best of the others, shape (s, k)."""
        return self.criterion("stable") / self._best_causal

    @property
    def rehearsed_ratio(self) -> np.ndarray:
        """C of the rehearsed stable inverse over the best of the others without rehearsal, shape (s, k)."""
        return self.criterion("stable", True) / self._best_causal

    @property
    def _best_causal(self) -> np.ndarray:
        return np.min([self.criterion(kind) for kind in KINDS[:-1]], axis=0)


def study_inverses(
    robot: RobotModel,
    payload: float,
    angle_deg: float = 5.0,
    grid: int = 2,
    spring_error: float = 0.0,
    seeds: int = 1,
    processes: int | None = None,
    progress: Callable[[float], None] | None = None,
    rehearse: bool = False,
) -> InvertStudy:
    """Simulates all of it.

    Args:
        robot: as the models know it.
        payload: mass at the flange in kg.
        angle_deg: by which axes 1 to 3 turn.
        grid: positions of axis 2, and of axis 3.
        spring_error: of every spring of the true robot, uniform within +- this share.
        seeds: how many such robots.
        processes: how many work at a time; None for one per core.
        progress: is called now and then with the share that is done, 0 to 1.
        rehearse: whether each motion is also made once to learn the springs from the motors' torques.

    Raises:
        ValueError: if a number is out of its range, a rehearsal has nothing to learn, or the robot or a model
            refuses.
        SimulationError: if a run broke off.
    """
    if grid < 1 or seeds < 1:
        raise ValueError(f"--grid and --seeds must be at least 1, got {grid} and {seeds}")
    if not 0.0 <= spring_error < 1.0:
        raise ValueError(f"--spring-error must be from 0 to below 1, got {spring_error:g}")
    if not 0.0 < abs(angle_deg) <= 45.0:
        raise ValueError(f"--angle must be up to 45 degrees and not zero, got {angle_deg:g}")
    if rehearse and not spring_error:
        raise ValueError("--rehearse learns springs that are off: give --spring-error too, such as 0.2")
    # The criterion is about the wrist, so that is the point which the stable inverse has exact.
    configs = {kind: FeedforwardConfig(kind, point="wrist") for kind in KINDS}
    for config in configs.values():  # what is impossible is refused here and not in a process
        FEEDFORWARDS[config.kind](ControllerModel(robot, payload), config)
    shares = np.linspace(*_SHARES, grid) if grid > 1 else np.array([np.mean(_SHARES)])
    axis_2, axis_3 = (robot.lower[1:3] + shares[:, None] * (robot.upper - robot.lower)[1:3]).T
    poses = np.zeros((grid * grid, NUM_JOINTS))
    poses[:, 1], poses[:, 2] = (each.ravel() for each in np.meshgrid(axis_2, axis_3, indexing="ij"))
    plants = [_true_robot(robot, spring_error, seed) for seed in range(seeds)] if spring_error else [None]
    trials = [
        Trial(robot, payload, pose, np.deg2rad(angle_deg), config, plant, settle=SETTLE, speeding_up=FAST)
        for config in configs.values()
        for plant in plants
        for pose in poses
    ]
    # The longest ones, if any, come first.
    last = trials[-len(plants) * len(poses) :]
    rehearsals = [Rehearsal(trial, spring_error, seed) for seed, trial in enumerate(last)] if rehearse else []
    found = in_processes(_work, [*rehearsals, *trials], processes, progress)
    results = iter(found[len(rehearsals) :])
    ringing = {kind: [[next(results) for _ in poses] for _ in plants] for kind in KINDS}
    rehearsed = {}
    for kind in REHEARSED if rehearse else ():
        of_kind = iter(each[kind] for each in found)
        rehearsed[kind] = [[next(of_kind) for _ in poses] for _ in plants]
    # From the first position in which every inverse is there.
    shown = next((i for i, one in enumerate(ringing["stable"][0]) if not one.refused), 0)
    example = {}
    seconds = np.nan
    for trial in trials[shown :: len(plants) * len(poses)]:
        started = time.perf_counter()
        try:
            example[trial.config.kind] = commands(trial, example_times(trial), _PERIOD)
        except ValueError:
            continue
        if trial.config.kind == "stable":
            seconds = time.perf_counter() - started
    return InvertStudy(
        robot, payload, angle_deg, spring_error, poses, ringing, rehearsed, shown, example, seconds
    )


def example_times(trial: Trial) -> np.ndarray:
    """Ticks in s, from a rest to a rest."""
    return np.arange(0.0, 2.0 * SETTLE + trial.profile.duration, _PERIOD)


def invert_json(study: InvertStudy) -> dict[str, Any]:
    """The numbers, with the units in their names."""
    ratio = study.ratio
    found = ratio[np.isfinite(ratio)]
    numbers = {
        "robot": study.robot.name,
        "payload_kg": study.payload,
        "angle_deg": study.angle_deg,
        "spring_error": study.spring_error,
        "robots": len(ratio),
        "positions": len(study.poses),
        "not_converged": int(np.isnan(study.criterion("stable")).sum()),
        "criterion": {kind: _of(np.median, study.found(kind)) for kind in KINDS},
        "ratio_stable": _of(np.median, found),
        "worst_ratio_stable": _of(np.max, found),
        "seconds": study.seconds if np.isfinite(study.seconds) else None,
    }
    if study.rehearsed:
        again = study.rehearsed_ratio[np.isfinite(study.rehearsed_ratio)]
        numbers["rehearsed"] = {
            "criterion": {kind: _of(np.median, study.found(kind, True)) for kind in REHEARSED},
            "ratio_stable": _of(np.median, again),
            "worst_ratio_stable": _of(np.max, again),
        }
    return numbers


def _of(function: Callable[[np.ndarray], Any], values: np.ndarray) -> float | None:
    return float(function(values)) if len(values) else None


def _true_robot(robot: RobotModel, share: float, seed: int) -> RobotModel:
    rng = np.random.default_rng(seed)
    gears, bearings, beams = (1.0 + share * rng.uniform(-1.0, 1.0, (NUM_JOINTS, n)) for n in (1, 2, 3))
    return varied(robot, Factors(gears[:, 0], bearings, beams))


def _work(job: Trial | Rehearsal, progress: Progress) -> Any:
    nothing = Ringing(np.zeros(0), np.zeros((0, 3)))
    kind = job.config.kind if isinstance(job, Trial) else "rehearsal"
    try:
        if isinstance(job, Rehearsal):
            found = job.run(progress)
            return {kind: Ringing(*found[kind]) if kind in found else nothing for kind in REHEARSED}
        return Ringing(*job.ringing(progress))
    except ValueError as error:  # no bounded motion, or one that begins long before the path
        return nothing if isinstance(job, Rehearsal) else replace(nothing, refused=str(error))
    except RuntimeError as error:
        raise SimulationError(f"{kind}: {' '.join(str(error).split())}") from error


def ahead_of_rigid(study: InvertStudy, kind: str) -> np.ndarray:
    """How far the motors of the shown pose are from those of a rigid robot, in rad, shape (n, 6)."""
    return study.example[kind][:, 0] - study.example["rigid"][:, 0]
