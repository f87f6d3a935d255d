"""What is left when a straight line ends: how far motors and tip still are from where they come to rest."""

from dataclasses import dataclass, replace

import numpy as np

from diagrams.runs.simulation import run
from diagrams.scenario.scenario import Scenario
from experiments.feedforward.rectangle import (
    LAW,
    RectangleTrial,
    feasible_pace,
    rectangle,
    rectangle_scenario,
    working_position,
)
from robots.kinematics.forward import Kinematics
from systems.reference.shapes import Rectangle

_SETTLE, _DWELL = 0.6, 0.6  # s at rest: the arm is first wound up, then comes to rest
_JUST_AFTER = 0.2  # s
PACE = 40.0  # 1/s^2, k_a, where joints are quick enough for it


@dataclass(frozen=True)
class Rest:
    """A distance in m after the end of a motion."""

    largest: float
    effective: float  # root of the mean square over 0.2 s


@dataclass(frozen=True)
class LineEnd:
    """What is left of a line."""

    motors: Rest  # of a rigid robot's tip on the motors from where the commands have it
    tip: Rest  # of the true tip from where it comes to rest


def line_scenario(trial: RectangleTrial, edge: int, pace: float = PACE) -> Scenario:
    """The scenario of one edge of a trial's rectangle, from rest to rest.

    Args:
        trial: robot, payload and feedforward.
        edge: 0 to 3.
        pace: k_a in 1/s^2, lowered where a joint is too slow for it.
    """
    scenario = rectangle_scenario(trial)
    home = working_position(trial.robot)
    path = Rectangle(rectangle(trial.robot, home)[edge : edge + 2])
    reference = replace(scenario.reference, path=path, acceleration=pace, settle=_SETTLE, dwell=_DWELL)
    return replace(
        scenario, reference=replace(reference, acceleration=feasible_pace(trial.robot, home, reference))
    )


def line_end(trial: RectangleTrial, scenario: Scenario) -> LineEnd:
    """Simulates a line with an elastic structure; the scenario is that of `line_scenario`, or one like it."""
    log = run(scenario, LAW, trial.robot, plant=trial.plant)
    after = log.time > log.dwell_start + scenario.reference.preview
    kinematics = Kinematics(trial.robot)
    wanted = kinematics.forward(log.position_command[-1])[:3, 3]
    motors = np.array([kinematics.forward(theta)[:3, 3] for theta in log.joint_position[after]])
    tip = log.X_WE_true[after, :3, 3]
    soon = log.time[after] <= log.dwell_start + scenario.reference.preview + _JUST_AFTER
    return LineEnd(_rest(motors - wanted, soon), _rest(tip - tip[-1], soon))


def _rest(gap: np.ndarray, soon: np.ndarray) -> Rest:
    distance = np.linalg.norm(gap, axis=1)
    return Rest(float(distance.max()), float(np.sqrt(np.mean(distance[soon] ** 2))))
