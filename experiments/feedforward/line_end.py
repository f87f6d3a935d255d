"""What is left when a straight line ends: how far motors and tip still are from where they come to rest."""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from statistics import median

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import DiagramBuilder

from diagrams.runs.simulation import run
from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario
from experiments.feedforward.rectangle import (
    LAW,
    RectangleTrial,
    feasible_pace,
    rectangle,
    rectangle_scenario,
    working_position,
)
from robots.description.model import NUM_JOINTS, load_robot
from robots.kinematics.forward import Kinematics
from systems.feedforward import FeedforwardConfig
from systems.feedforward.predictive.config import PredictiveConfig
from systems.feedforward.predictive.correction import PredictiveCorrection
from systems.reference.reference import Reference
from systems.reference.shapes import Rectangle
from systems.samples import JointSample

_SETTLE, _DWELL = 0.6, 0.6  # s at rest: the arm is first wound up, then comes to rest
_JUST_AFTER = 0.2  # s
_TIMED = 600  # ticks
_BEHIND, _WAVES = 1e-4, 20.0  # rad and rad/s: how motors stray while a tick is timed
_EDGES = 4
_ROBOTS = ("kr16", "kr210")
KIND = "elastic_structure"  # of the inverse model
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


def tick_time(trial: RectangleTrial) -> float:
    """The median time in s of a tick of the correction alone, along a line, without the simulation.

    What the correction asks for is there already: path, commands and a sample.
    """
    scenario = line_scenario(trial, 0)
    model = controller_model(scenario, trial.robot)
    period, home = model.period, np.deg2rad(scenario.home_deg)
    builder = DiagramBuilder()
    reference = builder.AddSystem(Reference(scenario.reference, period))
    correction = builder.AddSystem(PredictiveCorrection(model, trial.config.predictive))
    builder.Connect(reference.GetOutputPort("reference"), correction.GetInputPort("reference"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = correction.GetMyMutableContextFromRoot(context)
    correction.GetInputPort("position_command").FixValue(own, home)
    correction.GetInputPort("velocity_command").FixValue(own, np.zeros(NUM_JOINTS))
    seconds, phases = [], np.arange(NUM_JOINTS)
    for tick in range(round(scenario.reference.settle / period), _TIMED):
        context.SetTime(tick * period)
        angle = _WAVES * tick * period + phases
        theta, speed = home + _BEHIND * np.sin(angle), _BEHIND * _WAVES * np.cos(angle)
        sample = JointSample(tick * period, theta, speed, running=True)
        correction.GetInputPort("joint_sample").FixValue(own, Value(sample))
        started = time.perf_counter()
        own.SetDiscreteState(correction.EvalUniquePeriodicDiscreteUpdate(own))
        seconds.append(time.perf_counter() - started)
    return median(seconds)


def _rest(gap: np.ndarray, soon: np.ndarray) -> Rest:
    distance = np.linalg.norm(gap, axis=1)
    return Rest(float(distance.max()), float(np.sqrt(np.mean(distance[soon] ** 2))))


def trials(name: str, plant: str | None = None) -> tuple[RectangleTrial, RectangleTrial]:
    """Without and with the predictive correction, with the largest payload and another robot in the station.

    Args:
        name: of the robot that the controller believes in.
        plant: of the true one; None for its realistic variant.
    """
    robot, true = load_robot(name), load_robot(plant or f"{name}-realistic")
    configs = (FeedforwardConfig(KIND), FeedforwardConfig(KIND, predictive=PredictiveConfig("motors")))
    without, corrected = (RectangleTrial(robot, robot.payload.largest_mass, each, true) for each in configs)
    return without, corrected


def rows(name: str) -> Iterator[str]:
    """A line of text for each edge, without and with the correction, then the time of a tick."""
    pair = trials(name)
    for edge in range(_EDGES):
        for label, trial in zip(("alone", "corrected"), pair, strict=True):
            found = line_end(trial, line_scenario(trial, edge))
            values = (found.motors.largest, found.motors.effective, found.tip.largest, found.tip.effective)
            text = "".join(f"{1e3 * value:9.3f}" for value in values)
            yield f"{name:6} line {edge + 1} {label:10} {text} mm"
    yield f"{name:6} a tick of the correction {1e3 * tick_time(pair[1]):.2f} ms"


if __name__ == "__main__":
    print(f"{'':25}{'motors: largest, effective':>20}{'tip: largest, effective':>26}")
    for robot in sys.argv[1:] or _ROBOTS:
        for row in rows(robot):
            print(row, flush=True)
