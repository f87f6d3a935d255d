"""One law after the other on random robots: each seed draws a robot, its errors and the camera's noise."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from diagrams.runs.simulation import run
from diagrams.scenario.carried import carried_over, with_robot
from diagrams.scenario.scenario import Scenario, load_scenario
from experiments.cli.workers import Executor, LocalProcesses, Progress, in_order
from experiments.comparison.compare import simulating
from experiments.metrics.laps import lap_metrics
from experiments.metrics.run_metrics import error_metrics, pose_errors
from experiments.metrics.unfinished import unfinished
from experiments.robustness.calibrated import calibrated_robots
from experiments.robustness.contenders import Contender
from experiments.robustness.mixed import Mixture
from robots.description.model import RobotModel, load_robot
from systems.reference.paths import make_path

_NOTHING_BESIDE = Contender("open_loop", "open_loop")


@dataclass(frozen=True)
class Case:
    """A degraded station."""

    name: str
    settings: tuple[str, ...] = ()  # of the scenario, as ``--set`` takes them
    recovered_at: float | None = None  # s, from when on what has happened must be made up for
    draw: Callable[[int], Mixture] | None = None  # what else a seed draws


@dataclass(frozen=True)
class Trial:
    """One law on one robot."""

    scenario: str
    case: Case
    contender: Contender
    seed: int
    path: str
    laps: int
    robot: str | None = None  # in place of the scenario's, which is carried over to it
    calibrated: RobotModel | None = None  # as the controller knows it

    @property
    def drawn(self) -> Mixture:
        """What the seed draws beside the errors."""
        return self.case.draw(self.seed) if self.case.draw else Mixture()

    @property
    def settings(self) -> list[str]:
        """Of the scenario."""
        drawn = ("seed", "station.errors.random.seed", "station.variation.seed")
        return [
            *self.drawn.settings,
            *self.case.settings,
            *self.contender.settings,
            *(f"{name}={self.seed}" for name in drawn),
            f"reference.path={self.path}",
            f"reference.laps={self.laps}",
        ]

    def load(self) -> Scenario:
        """The scenario.

        Raises:
            ValueError: if it ends before what happens in its case must be made up for, and what
                `load_scenario` and `carried_over` raise.
        """
        scenario = load_scenario(self.scenario, self.settings)
        robot = self.robot or self.drawn.robot
        if robot is not None:
            named = with_robot(scenario, robot)
            scenario = carried_over(named, load_robot(scenario.robot), load_robot(robot))[0]
        if self.case.recovered_at is not None:
            end = make_path(scenario.reference).duration
            if end <= self.case.recovered_at:
                raise ValueError(
                    f"case {self.case.name}: the path ends at {end:.1f} s, what happens on it must be made "
                    f"up for by {self.case.recovered_at:g} s: take a slower one, or more --laps"
                )
        return scenario


def trials(
    scenario: str,
    cases: Sequence[Case],
    compared: Sequence[Contender],
    seeds: Sequence[int],
    paths: Sequence[str],
    laps: int = 1,
    robot: str | None = None,
) -> list[Trial]:
    """All combinations, seed by seed, so that the first results are of all laws."""
    return [
        Trial(scenario, case, contender, seed, path, laps, robot)
        for case in cases
        for seed in seeds
        for path in paths
        for contender in compared
    ]


def with_calibrated_robots(
    todo: Sequence[Trial],
    settings: tuple[str, ...],
    executor: Executor,
    progress: Callable[[float], None] | None = None,
) -> list[Trial]:
    """Calibrates the robots of all trials that want one, each where nothing but its errors disturbs it.

    Args:
        todo: the trials.
        settings: of the scenario, whatever the case.
        executor: where the measurements are simulated.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        SimulationError: if a simulation broke off.
        ValueError: if the measurements do not determine a robot.
    """
    measured = {
        trial.seed: replace(trial, case=Case("measured", settings), contender=_NOTHING_BESIDE).load()
        for trial in todo
        if trial.contender.is_calibrated
    }
    robots = calibrated_robots(measured, executor, progress)
    return [
        replace(trial, calibrated=robots[trial.seed]) if trial.contender.is_calibrated else trial
        for trial in todo
    ]


def run_trials(
    todo: Sequence[Trial],
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[dict[str, Any]]:
    """Runs them, by default in one process per core; rows in the order of the trials.

    Raises:
        ValueError: if a scenario is refused.
        SimulationError: if a process was ended from outside.
    """
    return in_order(executor or LocalProcesses(), run_trial, todo, progress)


def run_trial(trial: Trial, progress: Progress) -> dict[str, Any]:
    """The numbers of one run; of one that broke off or that the guard ended, ``failure`` in place of them."""
    row: dict[str, Any] = {
        "case": trial.case.name,
        "law": trial.contender.text,
        "seed": trial.seed,
        "path": trial.path,
        "failure": None,
    }
    if trial.case.draw:
        row |= {"robot": trial.robot or trial.drawn.robot, "settings": list(trial.drawn.settings)}
    try:
        with simulating(trial.contender.text, trial.seed):
            log = run(trial.load(), trial.contender.law, trial.calibrated, progress=progress)
    except RuntimeError as error:  # a SimulationError; the others shall go on
        return row | {"failure": str(error)}
    if ending := unfinished(log):  # its figures would be those of another task
        return row | {"failure": ending}
    errors = error_metrics(log, "true")
    if trial.case.recovered_at is not None:
        e = pose_errors(log, "true")[log.time >= trial.case.recovered_at]
        row["recovered_mm"] = 1e3 * float(np.linalg.norm(e[:, 3:], axis=1).max())
    coverage = (log.learnt or {}).get("coverage")
    if coverage and coverage["samples"]:
        row["coverage"] = coverage
    return row | {
        "max_norm_mm": errors["max_norm_mm"],
        "max_angle_deg": errors["max_angle_deg"],
        "static_mm": float(np.linalg.norm(errors["static_mm"])),
        "static_deg": float(np.linalg.norm(errors["static_deg"])),
        "laps": lap_metrics(log, pose_errors(log, "true")),
        "guard": {kind: count for kind, count in log.guard_counts.items() if count},
        "wall_s": log.wall_time,
    }


def judged(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Worst and median of the rows of one law in one case.

    Returns:
        ``laps``: per lap ``max_norm_mm``, ``max_angle_deg`` and ``times_planned``, how many times the planned
        time it took, then ``static_mm``, as (worst, median) each;
        ``recovered_mm``: largest distance after what happens, where something does, likewise;
        ``coverage``: share of samples in which the true tip was within the ellipsoid of 95 % of a law that
        predicts it, as (smallest of a run, of all samples);
        ``worst_seed`` and ``worst_path`` of the largest distance, and ``worst_robot`` where seeds draw it;
        ``guard``: interventions of all runs;
        ``failures``: runs that broke off, or that the guard ended before their path was over.
    """
    done = [row for row in rows if row["failure"] is None]
    result: dict[str, Any] = {
        "runs": len(rows),
        "failures": [
            f"seed {row['seed']}, {row['path']}: {row['failure']}" for row in rows if row["failure"]
        ],
    }
    if not done:
        return result
    worst = max(done, key=lambda row: row["max_norm_mm"])
    laps = [
        {
            name: _worst_and_median([row["laps"][lap][name] for row in done])
            for name in ("max_norm_mm", "max_angle_deg", "times_planned")
        }
        for lap in range(len(done[0]["laps"]))
    ]
    if "recovered_mm" in done[0]:
        result["recovered_mm"] = _worst_and_median([row["recovered_mm"] for row in done])
    said = [row["coverage"] for row in done if "coverage" in row]
    if said:
        samples = sum(each["samples"] for each in said)
        inside = sum(each["share"] * each["samples"] for each in said)
        result["coverage"] = min(each["share"] for each in said), inside / samples
    if "robot" in worst:
        result["worst_robot"] = worst["robot"]
    return result | {
        "laps": laps,
        "static_mm": _worst_and_median([row["static_mm"] for row in done]),
        "static_deg": _worst_and_median([row["static_deg"] for row in done]),
        "worst_seed": worst["seed"],
        "worst_path": worst["path"],
        "guard": sum(sum(row["guard"].values()) for row in done),
    }


def _worst_and_median(values: Sequence[float]) -> tuple[float, float]:
    return float(np.max(values)), float(np.median(values))
