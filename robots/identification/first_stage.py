"""Springs and dampers from starts that are far off: linear gears, few cases, ringing let in by and by.

A spring that is off by half lets the modelled ringing run away from the measured one by whole periods, and
then nothing draws it back. How far the arm yields while it speeds up and slows down tells springs from any
start, so that readings soon after the motions count first.
"""

from collections.abc import Callable, Sequence

import numpy as np

from robots.identification.arm_along_motion import ArmAlongMotion, ElasticArm
from robots.identification.arm_fit import ArmProblem
from robots.identification.arm_response import ArmResponse, Grid
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.motion import MotionCase, SensorPlace

NEAR = 1e-3  # relative, at which a stage is left for the next one
COARSE = Grid(1, 2, 4)
_FEW = 6  # cases
# s after the motions up to which readings count, and the largest number of steps.
_HORIZONS = ((0.05, 15), (0.1, 10), (0.2, 10), (0.4, 8), (np.inf, 8))
_MOVES = 1e-2  # of the largest speed of a case


class FirstStage:
    """The problem of the first stage with the times of the sensors as they were found, for any search."""

    def __init__(
        self,
        arm: ElasticArm,
        cases: Sequence[MotionCase],
        sensors: list[SensorPlace],
        ratio: np.ndarray,
        known: np.ndarray,
    ) -> None:
        """Takes cases on the robot's time, and unknowns that are good enough to weigh the readings by.

        Args:
            arm: as it is believed to be.
            cases: all of them.
            sensors: in the order of their readings.
            ratio: of the gears, (6,).
            known: springs and times, the first of them are used.
        """
        self.parameters = ElasticParameters(arm, gear_parts=False)
        chosen = few(len(cases))
        self._cases = [cases[i] for i in chosen]
        self._motions = [arm.along(case) for case in self._cases]
        self._sensors, self._ratio = sensors, ratio
        self._floor = sensor_floor(sensors)
        self._problem = self._until(np.inf)
        self._spread = self._problem.spread(known[: len(self.parameters)], self._floor)
        speeds = np.array([np.abs(case.rate).max() for case in self._cases])
        self._fast = speeds > np.median(speeds)
        self.evaluations = 0

    def solve(self, start: np.ndarray) -> np.ndarray:
        """The unknowns by the gradient, from a start."""

        def build(horizon: float) -> ArmProblem:
            problem = self._until(horizon)
            problems.append(problem)
            return problem

        problems: list[ArmProblem] = []
        found = solve_from_afar(build, start, self._floor, lambda shift: None)
        self.evaluations += sum(problem.evaluations for problem in problems)
        return found

    def costs(self, p: np.ndarray) -> np.ndarray:
        """Of the slower and of the faster motions, (2,); see `ArmProblem.cost`."""
        self.evaluations += 1
        each = self._problem.cost(p, self._spread)
        return np.array([each[~self._fast].sum(), each[self._fast].sum()])

    def cost(self, p: np.ndarray) -> float:
        """Of all motions."""
        return float(self.costs(p).sum())

    def _until(self, horizon: float) -> ArmProblem:
        return arm_problem(
            self._motions, self._cases, self._sensors, self.parameters, self._ratio, horizon=horizon
        )


def solve_from_afar(
    build: Callable[[float], ArmProblem],
    p: np.ndarray,
    floor: np.ndarray,
    moved: Callable[[np.ndarray], None],
) -> np.ndarray:
    """Solves with a horizon behind the motions that grows.

    Args:
        build: the problem up to a horizon in s.
        p: the start.
        floor: below which readings do not scatter, (channels,).
        moved: is told by how many samples the times of the sensors were off, before the horizon grows.
    """
    for horizon, steps in _HORIZONS:
        problem = build(horizon)
        p, shift = problem.solve(p, problem.spread(p, floor), steps, 5.0 * NEAR)
        if np.isfinite(horizon):
            moved(shift)
    return p


def arm_problem(
    motions: Sequence[ArmAlongMotion],
    cases: Sequence[MotionCase],
    sensors: Sequence[SensorPlace],
    parameters: ElasticParameters,
    ratio: np.ndarray,
    grid: Grid = COARSE,
    rests: np.ndarray | None = None,
    horizon: float = np.inf,
) -> ArmProblem:
    """The problem of some cases, with readings up to a time in s after the motions; see `ArmResponse`."""
    response = ArmResponse(motions, cases, sensors, parameters, ratio, grid, rests)
    measured = np.full((len(response.kept), len(cases), 3 * len(sensors)), np.nan)
    for column, case in enumerate(cases):
        end = min(len(case.theta), moving(case)[1] + horizon / case.period)
        kept = response.kept[response.kept < end]
        measured[: len(kept), column] = case.readings[kept].reshape(len(kept), -1)
    return ArmProblem(response, measured, parameters)


def moving(case: MotionCase) -> tuple[int, int]:
    """The first sample at which a motor moves, and the one after the last."""
    speed = np.abs(case.rate).max(1)
    samples = np.flatnonzero(speed > _MOVES * max(speed.max(), 1e-12))
    return (int(samples[0]), int(samples[-1]) + 1) if len(samples) else (0, len(speed))


def few(cases: int) -> list[int]:
    """Those of so many cases that the first stages use."""
    return list(range(0, cases, max(1, cases // _FEW)))


def sensor_floor(sensors: Sequence[SensorPlace]) -> np.ndarray:
    """Noise of the channels, below which readings do not scatter, (channels,)."""
    return np.repeat([max(sensor.sigma, 1e-9) for sensor in sensors], 3)
