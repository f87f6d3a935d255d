"""The gradient against searches without one, on one problem, from starts that are off by a factor of two.

The problem is that of the first stage of an identification: springs and dampers with linear gears, few
motions, times of the sensors as they were found. Each search is a job of its own.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from experiments.cli.workers import Executor, Progress, in_order
from experiments.identify.study import IdentifyStudy
from robots.identification.arm_along_motion import ArmAlongMotion, ElasticArm
from robots.identification.arm_fit import ArmProblem
from robots.identification.arm_response import Grid
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.first_stage import arm_problem, few, sensor_floor, solve_from_afar
from robots.identification.global_search import POPULATION, Box
from robots.identification.motion import MotionCase, SensorPlace

OFF = 2.0  # times, by which springs are off at the start
_WIDE = 1.2  # of the logarithms from the start, within which is searched: a factor of 3.3
_FAILED = 1.05  # times the least cost of all searches
LEAST_EVALUATIONS = 2 * POPULATION
GRADIENT, CMA, GENETIC, FRONT = "gradient", "CMA-ES", "genetic, then pattern", "Pareto front"
SEARCH_HEAD = ["method", "cost", "furthest spring", "evaluations", "CPU s", "starts that fail"]


@dataclass(frozen=True)
class StagedProblem:
    """Springs and dampers of an arm with linear gears; what a job needs of it."""

    motions: list[ArmAlongMotion]
    cases: list[MotionCase]
    sensors: list[SensorPlace]
    parameters: ElasticParameters
    ratio: np.ndarray
    spread: np.ndarray  # (channels,)

    def until(self, horizon: float = np.inf) -> ArmProblem:
        """With readings up to a time in s after the motions."""
        return arm_problem(
            self.motions, self.cases, self.sensors, self.parameters, self.ratio, horizon=horizon
        )


@dataclass(frozen=True)
class SearchRun:
    """One search from one start, or of the front."""

    method: str
    start: int  # its number
    values: np.ndarray  # (n,) unknowns that were found, or (k, n) on the front
    cost: np.ndarray  # (), or (k, 2) on the front
    evaluations: int
    seconds: float  # of the processor


@dataclass(frozen=True)
class SearchComparison:
    """All of them; n unknowns, s springs first."""

    springs: list[str]  # names
    runs: list[SearchRun]
    front: SearchRun  # costs of the slower and of the faster motions that cannot both be less

    @property
    def best(self) -> SearchRun:
        """The one with the least cost."""
        return min(self.runs, key=lambda run: float(run.cost))

    def failed(self, run: SearchRun) -> bool:
        """Whether it ended clearly above the best one."""
        return float(run.cost) > _FAILED * float(self.best.cost)

    def apart(self, run: SearchRun) -> float:
        """By which share the spring that is furthest from that of the best run differs from it."""
        springs = slice(0, len(self.springs))
        return float(np.expm1(np.abs(run.values - self.best.values)[springs]).max())


@dataclass(frozen=True)
class _Job:
    problem: StagedProblem
    method: str
    number: int
    start: np.ndarray  # (n,)
    evaluations: int
    seed: int

    def run(self) -> SearchRun:
        begun, problem = time.process_time(), self.problem.until()
        spread, problems = self.problem.spread, [problem]

        def cost(p: np.ndarray) -> float:
            return float(problem.cost(p, spread).sum())

        def costs(p: np.ndarray) -> np.ndarray:
            of_cases = problem.cost(p, spread)
            fast = _fast(self.problem.cases)
            return np.array([of_cases[~fast].sum(), of_cases[fast].sum()])

        box = Box(self.start - _WIDE, self.start + _WIDE, self.evaluations, self.seed)
        found = None
        if self.method == FRONT:
            found, values = box.front(costs, self.start)
        elif self.method == CMA:
            values = box.cma(cost, self.start)
        elif self.method == GENETIC:
            values = box.genetic(cost, self.start)
        else:

            def build(horizon: float) -> ArmProblem:
                problems.append(self.problem.until(horizon))
                return problems[-1]

            floor = sensor_floor(self.problem.sensors)
            values = solve_from_afar(build, self.start, floor, lambda shift: None)
        evaluations = sum(each.evaluations for each in problems)
        found = np.array(cost(values)) if found is None else found
        seconds = time.process_time() - begun
        return SearchRun(self.method, self.number, values, found, evaluations, seconds)


def compare_searches(
    study: IdentifyStudy,
    starts: int,
    evaluations: int,
    seed: int,
    executor: Executor,
    progress: Callable[[float], None] | None = None,
) -> SearchComparison:
    """Runs all searches from all starts, then from the best one for the front of slower and faster motions.

    Args:
        study: what was identified; its cases are on the robot's time.
        starts: how many, every spring of which is by a factor of two stiffer or softer than believed.
        evaluations: of each search without a gradient.
        seed: of starts and searches.
        executor: where the searches are run, each of them a job.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        ModuleNotFoundError: if pymoo is not installed.
    """
    problem = staged_problem(study)
    parameters, rng = problem.parameters, np.random.default_rng(seed)
    springs = parameters.of_kind("stiffness")
    jobs = []
    for number in range(1, starts + 1):
        start = parameters.start.copy()
        start[springs] += np.log(OFF) * rng.choice([-1.0, 1.0], size=len(springs))
        jobs += [
            _Job(problem, method, number, start, evaluations, seed + number)
            for method in (GRADIENT, CMA, GENETIC)
        ]
    tell = progress or (lambda share: None)
    done = len(jobs) / (len(jobs) + 1)
    runs = in_order(executor, _run, jobs, lambda share: tell(done * share))
    names = [parameters.names[i] for i in springs]
    best = min(runs, key=lambda run: float(run.cost))
    front = in_order(executor, _run, [_Job(problem, FRONT, 0, best.values, evaluations, seed)])[0]
    tell(1.0)
    return SearchComparison(names, runs, front)


def check_pymoo() -> None:
    """Raises ValueError if pymoo is not installed."""
    if find_spec("pymoo") is None:
        raise ValueError("--search needs pymoo: pip install 'truetip[search]'")


def staged_problem(study: IdentifyStudy) -> StagedProblem:
    """Few motions of an identification, linearised about where the arm was found to sag and to ring."""
    found, ratio = study.found, study.robot.gear_ratio
    plain = ElasticParameters(found.arm, gear_parts=False)
    p = found.fit.values[: len(plain)]
    cases = [found.cases[i] for i in few(len(found.cases))]
    arm = ElasticArm(study.identified, study.payload, found.sensors)
    motions = [arm.along(case) for case in cases]
    moved = arm_problem(motions, cases, found.sensors, plain, ratio, Grid()).moved(p)
    motions = [arm.about(*each) for each in zip(cases, motions, moved, strict=True)]
    spread = arm_problem(motions, cases, found.sensors, plain, ratio).spread(p, sensor_floor(found.sensors))
    return StagedProblem(motions, cases, found.sensors, plain, ratio, spread)


def _fast(cases: list[MotionCase]) -> np.ndarray:
    """Which cases are the faster half, (cases,) bool."""
    speed = np.array([np.abs(case.rate).max() for case in cases])
    fast = np.zeros(len(cases), dtype=bool)
    fast[np.argsort(speed)[len(cases) // 2 :]] = True
    return fast


def _run(job: _Job, progress: Progress) -> SearchRun:
    return job.run()


def search_json(comparison: SearchComparison) -> dict[str, Any]:
    """The numbers."""
    springs = len(comparison.springs)
    return {
        "runs": [
            {
                "method": run.method,
                "start": run.start,
                "cost": float(run.cost),
                "evaluations": run.evaluations,
                "seconds": run.seconds,
                "failed": comparison.failed(run),
                "furthest_spring": comparison.apart(run),
                "of_first_belief": dict(
                    zip(comparison.springs, np.exp(run.values[:springs]).tolist(), strict=True)
                ),
            }
            for run in comparison.runs
        ],
        "pareto_front": comparison.front.cost.tolist(),
    }


def search_rows(comparison: SearchComparison) -> list[list[str]]:
    """A row for each method: cost, furthest spring, evaluations, time, starts that fail."""
    rows = []
    for method in dict.fromkeys(run.method for run in comparison.runs):
        runs = [run for run in comparison.runs if run.method == method]
        costs, apart = [float(run.cost) for run in runs], [comparison.apart(run) for run in runs]
        rows.append(
            [
                method,
                f"{min(costs):.0f} to {max(costs):.0f}",
                f"{min(apart):.1%} to {max(apart):.1%}",
                f"{np.median([run.evaluations for run in runs]):.0f}",
                f"{np.median([run.seconds for run in runs]):.0f}",
                f"{sum(map(comparison.failed, runs))} of {len(runs)}",
            ]
        )
    return rows
