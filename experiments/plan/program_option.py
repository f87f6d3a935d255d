"""``--program``: planned motions in the language of a robot's controller."""

from collections.abc import Sequence

import numpy as np

from experiments.cli.option_limits import one_of
from experiments.plan.study import LegResult
from robots.description.model import RobotModel
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error
from robots.programs.planned_moves import MOVES, PlannedMove


def check_language(language: str | None) -> None:
    """Raises ValueError if no controller speaks it."""
    one_of("--program", MOVES, language)


def program_files(language: str, robot: RobotModel, results: Sequence[LegResult]) -> dict[str, str]:
    """Texts of a program by the names of its files.

    Raises:
        ValueError: if the language cannot say one of the motions; with its name.
    """
    return MOVES[language]([_move(robot, each) for each in results])


def _move(robot: RobotModel, result: LegResult) -> PlannedMove:
    timing, path = result.planned.timing, result.leg.path
    ends = path.at(np.array([0.0, 1.0]))
    start, goal = Kinematics(robot).forward(ends)
    R_WB = robot.base.pose().rotation().matrix()
    demand = result.dynamics.demand(timing.rates(timing.times))
    return PlannedMove(
        result.leg.name,
        ends,
        timing.duration,
        np.abs(demand.speed).max(axis=0) / robot.speed,
        np.abs(demand.acceleration).max(axis=0) / robot.acceleration,
        result.leg.is_straight,
        R_WB.T @ (goal[:3, 3] - start[:3, 3]),
        float(np.linalg.norm(pose_error(goal, start)[:3])),
        float(demand.tool_speed.max()),
    )
