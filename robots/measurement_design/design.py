"""Optimal experiment design: the configurations that determine the error parameters best, with a bound."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.measurement_design.candidate_grid import SOURCE_RANGES, AxisRange, CandidateGrid
from robots.measurement_design.candidates import Admissible, Candidates
from robots.measurement_design.criteria import SmallestEigenvalue, criterion
from robots.measurement_design.detmax import whole_design
from robots.measurement_design.relaxed_design import relaxed_design
from robots.measurement_design.visiting_order import visiting_order

LARGEST_COUNT = 2000


@dataclass(frozen=True)
class MeasurementDesign:
    """Configurations to measure at, in the order of the visits.

    The bound holds for every design of as many measurements on the same grid under the same restrictions:
    it is ``count`` times the largest gain of the certificate among the candidates.
    """

    criterion: str  # one of robots.measurement_design.criteria.NAMES
    configurations: np.ndarray  # (count, 6) rad
    value: float  # of the criterion
    bound: float  # of the criterion
    b3: float  # smallest eigenvalue of the information matrix in m and rad
    certificate: np.ndarray  # (rank, r)
    num_candidates: int
    num_refused: int  # candidates that came into question and were not admissible


def design_measurements(
    robot: RobotModel,
    count: int = 75,
    criterion_name: str = "b3",
    position_only: bool = False,
    ranges: tuple[AxisRange, ...] = SOURCE_RANGES,
    admissible: Admissible | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> MeasurementDesign:
    """Finds configurations that are all different and nearly as good as any; about 3 s for 75 and B3.

    Args:
        robot: the nominal robot.
        count: how many configurations.
        criterion_name: ``"b3"``, ``"d"`` or ``"i"``, see `robots.measurement_design.criteria`.
        position_only: whether only the position of the tool will be measured.
        ranges: the candidates of each joint; by default those of Probst (2024), section 4.2.
        admissible: which configurations are allowed; None for all.
        seed: the same seed gives the same design.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        ValueError: if the count is too small to see all parameters, or too few candidates are admissible.
    """
    grid = CandidateGrid(robot, ranges, position_only)
    fewest = math.ceil(grid.parameters.rank / (3 if position_only else NUM_JOINTS))
    if not fewest <= count <= min(LARGEST_COUNT, len(grid)):
        raise ValueError(
            f"design: count must be between {fewest}, which {grid.parameters.rank} parameters need, and "
            f"{min(LARGEST_COUNT, len(grid))}, got {count}"
        )
    candidates = Candidates(grid, admissible)
    goal = criterion(criterion_name, robot, grid)
    report = progress or (lambda share: None)
    relaxed = relaxed_design(candidates, goal, np.random.default_rng(seed), lambda share: report(0.5 * share))
    whole = whole_design(candidates, goal, relaxed, count, lambda share: report(0.5 + 0.5 * share))
    q = grid.configurations(whole.numbers)
    order = visiting_order(q, np.zeros(NUM_JOINTS))
    return MeasurementDesign(
        criterion=criterion_name,
        configurations=q[order],
        value=whole.value,
        bound=count * relaxed.bound,
        b3=float(SmallestEigenvalue().value(grid.information(q).sum(axis=0))),
        certificate=relaxed.certificate,
        num_candidates=len(grid),
        num_refused=candidates.num_refused,
    )
