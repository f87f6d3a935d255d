"""Springs and dampers from starts that are far off: linear gears, few cases, ringing let in by and by.

A spring that is off by half lets the modelled ringing run away from the measured one by whole periods, and
then nothing draws it back. How far the arm yields while it speeds up and slows down tells springs from any
start, so that readings soon after the motions count first.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from robots.identification.arm_along_motion import ArmAlongMotion
from robots.identification.arm_fit import ArmProblem
from robots.identification.arm_response import ArmResponse, Grid
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.motion import MotionCase, SensorPlace

NEAR = 1e-3  # relative, at which a stage is left for the next one
# At which the last one ends: far below what noise leaves open, so that no part of the data still pulls the
# unknowns, which would count as if it disagreed with the others.
CONVERGED = 1e-5
COARSE = Grid(1, 2, 4)
_FEW = 6  # cases
# s after the motions up to which readings count, and the largest number of steps.
_HORIZONS = ((0.05, 15), (0.1, 10), (0.2, 10), (0.4, 8), (np.inf, 8))
_MOVES = 1e-2  # of the largest speed of a case


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
    ends = [_end(case, horizon) for case in cases]
    cases = [
        replace(case, theta=case.theta[:end], rate=case.rate[:end], readings=case.readings[:end])
        for case, end in zip(cases, ends, strict=True)
    ]
    motions = [
        replace(motion, load=motion.load[:end], readings=motion.readings[:end])
        for motion, end in zip(motions, ends, strict=True)
    ]
    response = ArmResponse(motions, cases, sensors, parameters, ratio, grid, rests)
    measured = np.full((len(response.kept), len(cases), 3 * len(sensors)), np.nan)
    for column, case in enumerate(cases):
        kept = response.kept[response.kept < len(case.theta)]
        measured[: len(kept), column] = case.readings[kept].reshape(len(kept), -1)
    return ArmProblem(response, measured, parameters)


def _end(case: MotionCase, horizon: float) -> int:
    """How many samples there are up to a time in s after the motion."""
    samples = len(case.theta)
    return samples if np.isinf(horizon) else min(samples, moving(case)[1] + round(horizon / case.period))


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
