"""Three feedforwards on one robot: a rectangle in space, and motions from a grid of positions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.cli.workers import Progress, SimulationError, in_processes
from experiments.feedforward.rectangle import Deviation, RectangleTrial, rectangle_edges
from experiments.feedforward.tick import tick_time
from experiments.feedforward.trial import Trial
from robots.description.model import RobotModel
from systems.controller_model import ControllerModel
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig

KINDS: tuple[str, ...] = ("rigid", "flexible_joint", "elastic_structure")
PLANTS = ("exact", "realistic")
ANGLES_DEG = (5, 20)  # of the motions


@dataclass(frozen=True)
class FeedforwardStudy:
    """The results of a study; a grid has n positions each of axes 2 and 3, the other axes are at zero."""

    robot: RobotModel
    payload: float  # kg
    plant: str  # of `PLANTS`, what stands in the station
    config: FeedforwardConfig  # how wrong the models are
    timing: str  # of `systems.reference.timing.TIMINGS`
    axis_2: np.ndarray  # (n,) rad, where the motions begin
    axis_3: np.ndarray  # (n,) rad
    criterion: Mapping[int, Mapping[str, np.ndarray]]  # by angle in degrees and feedforward, (n, n) in m/s
    edges: tuple[float, float]  # m, of the rectangle, those away from the robot and across
    path: Mapping[str, Deviation]  # of the rectangle, by feedforward
    fast: Mapping[str, Deviation]  # of the small one with fast edges
    tick: Mapping[str, float]  # s, the median time of a tick with inverse kinematics, by feedforward

    def ratio(self, angle_deg: int) -> np.ndarray:
        """The criterion with an elastic structure in the model over the one without, (n, n)."""
        of_kind = self.criterion[angle_deg]
        return of_kind["elastic_structure"] / of_kind["flexible_joint"]


def study_feedforward(
    robot: RobotModel,
    payload: float,
    config: FeedforwardConfig,
    grid: int,
    processes: int | None = None,
    progress: Callable[[float], None] | None = None,
    realistic: RobotModel | None = None,
    timing: str = "polynomial",
) -> FeedforwardStudy:
    """Simulates all of it.

    Args:
        robot: which robot, as the models know it.
        payload: mass at the flange in kg.
        config: how wrong the models are; the kinds take turns.
        grid: positions of axis 2, and of axis 3, at least 2.
        processes: how many work at a time; None for one per core.
        progress: is called now and then with the share that is done, 0 to 1.
        realistic: what stands in the station; None for the robot exactly as the models know it.
        timing: of all motions; what is too rough for a model is accepted.

    Raises:
        ValueError: if the grid is too small, or the robot or a model refuses.
        SimulationError: if a run broke off.
    """
    if grid < 2:
        raise ValueError(f"--grid must be at least 2, got {grid}")
    config = replace(config, rough_path="accept")
    configs = {kind: replace(config, kind=kind) for kind in KINDS}
    for each in configs.values():  # what is impossible is refused here and not in a process
        FEEDFORWARDS[each.kind](ControllerModel(robot, payload), each)
    # From everywhere there is room for the largest motion.
    # Of a range of more than a turn, one turn.
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    axis_2, axis_3 = np.linspace(lower[1:3], upper[1:3] - np.deg2rad(max(ANGLES_DEG)), grid).T
    starts = [np.array([0.0, q2, q3, 0.0, 0.0, 0.0]) for q2 in axis_2 for q3 in axis_3]
    jobs: list[RectangleTrial | Trial] = [
        RectangleTrial(robot, payload, configs[kind], realistic, timing, is_fast)
        for is_fast in (False, True)
        for kind in KINDS
    ]
    rectangles = len(jobs)
    for angle in ANGLES_DEG:
        for kind in KINDS:
            jobs += [
                Trial(robot, payload, start, np.deg2rad(angle), configs[kind], realistic, timing)
                for start in starts
            ]
    results = in_processes(_work, jobs, processes, progress)
    path: dict[str, Any] = dict(zip(KINDS, results[: len(KINDS)], strict=True))
    fast: dict[str, Any] = dict(zip(KINDS, results[len(KINDS) : rectangles], strict=True))
    values = np.array(results[rectangles:], dtype=float).reshape(len(ANGLES_DEG), len(KINDS), grid, grid)
    criterion = {
        angle: dict(zip(KINDS, of_angle, strict=True))
        for angle, of_angle in zip(ANGLES_DEG, values, strict=True)
    }
    # Alone on a core, after the rest is done.
    tick = {kind: tick_time(RectangleTrial(robot, payload, configs[kind], timing=timing)) for kind in KINDS}
    plant = "realistic" if realistic else "exact"
    edges = rectangle_edges(robot)
    return FeedforwardStudy(
        robot, payload, plant, config, timing, axis_2, axis_3, criterion, edges, path, fast, tick
    )


def _work(job: RectangleTrial | Trial, progress: Progress) -> Deviation | float:
    try:
        return job.run(progress)
    except RuntimeError as error:
        raise SimulationError(f"{job.config.kind}: {' '.join(str(error).split())}") from error


def study_json(study: FeedforwardStudy) -> dict[str, Any]:
    """The numbers, with the units in their names; deviations relative to the rigid model."""
    return {
        "robot": study.robot.name,
        "payload_kg": study.payload,
        "plant": study.plant,
        "timing": study.timing,
        "stiffness_error": study.config.stiffness_error,
        "rectangle_m": list(study.edges),
        "path": _deviations(study.path),
        "sag": _part(study.path, "sag"),
        "dynamic": _part(study.path, "dynamic"),
        "fast_edges": {**_deviations(study.fast), "dynamic": _part(study.fast, "dynamic")},
        "criterion": {
            str(angle): {
                "median_ratio": float(np.median(study.ratio(angle))),
                "worst_ratio": float(study.ratio(angle).max()),
                "positions": study.ratio(angle).size,
                "median_m_s": {kind: float(np.median(c)) for kind, c in study.criterion[angle].items()},
            }
            for angle in study.criterion
        },
        "tick_us": {kind: 1e6 * tick for kind, tick in study.tick.items()},
    }


def _deviations(path: Mapping[str, Deviation]) -> dict[str, dict[str, float]]:
    rigid = path["rigid"]
    return {
        "integral": {kind: one.integral / rigid.integral for kind, one in path.items()},
        "max": {kind: one.max / rigid.max for kind, one in path.items()},
        "max_mm": {kind: 1e3 * one.max for kind, one in path.items()},
    }


def _part(path: Mapping[str, Deviation], name: str) -> dict[str, dict[str, float]]:
    """Of the deviation from a rectangle a part, in mm and relative to the rigid model."""
    values = {kind: getattr(one, name) for kind, one in path.items()}
    return {
        "mm": {kind: 1e3 * value for kind, value in values.items()},
        "relative": {kind: value / values["rigid"] for kind, value in values.items()},
    }
