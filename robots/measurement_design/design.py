"""Optimal experiment design: the configurations that determine the error parameters best, with a bound."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.measurement_design.candidate_grid import AxisRange, CandidateGrid
from robots.measurement_design.candidates import Admissible, Candidates
from robots.measurement_design.constraints import AdmissibleConfigurations
from robots.measurement_design.criteria import SmallestEigenvalue, criterion
from robots.measurement_design.detmax import whole_design
from robots.measurement_design.parameters import needs_complete
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
    num_parameters: int
    is_complete: bool  # whether they are those of the complete error model


def design_measurements(
    robot: RobotModel,
    count: int = 75,
    criterion_name: str = "b3",
    position_only: bool = False,
    ranges: tuple[AxisRange, ...] | None = None,
    admissible: Admissible | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
    is_complete: bool | None = None,
) -> MeasurementDesign:
    """Finds configurations that are all different and nearly as good as any; about 3 s for 75 and B3.

    Args:
        robot: the nominal robot.
        count: how many configurations.
        criterion_name: ``"b3"``, ``"d"`` or ``"i"``, see `robots.measurement_design.criteria`.
        position_only: whether only the position of the tool will be measured.
        ranges: the candidates of each joint; None for the robot's own.
        admissible: which configurations are allowed; None for all.
        seed: the same seed gives the same design.
        progress: is called now and then with the share that is done, 0 to 1.
        is_complete: whether the parameters are those of the complete error model; None where the 48 of Probst
            (2024) would miss something.

    Raises:
        ValueError: if the count is too small to see all parameters, or too few candidates are admissible.
    """
    complete = needs_complete(robot, position_only) if is_complete is None else is_complete
    grid = CandidateGrid(robot, ranges, position_only, complete)
    fewest = math.ceil(grid.parameters.rank / (3 if position_only else NUM_JOINTS))
    if not fewest <= count <= min(LARGEST_COUNT, len(grid)):
        raise ValueError(
            f"design: count must be between {fewest}, which {grid.parameters.rank} parameters need, and "
            f"{min(LARGEST_COUNT, len(grid))}, got {count}"
        )
    indifferent = (
        admissible.indifferent(grid.angles) if isinstance(admissible, AdmissibleConfigurations) else ()
    )
    candidates = Candidates(grid, admissible, indifferent)
    goal = criterion(criterion_name, robot, grid)
    report = progress or (lambda share: None)
    rng = np.random.default_rng(seed)
    relaxed = relaxed_design(candidates, goal, rng, lambda share: report(0.5 * share))
    whole = whole_design(candidates, goal, relaxed, count, rng, lambda share: report(0.5 + 0.5 * share))
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
        num_parameters=grid.parameters.rank,
        is_complete=complete,
    )
