"""What is left when a straight line ends: how far motors and tip still are from where they come to rest.

``python -m experiments.feedforward.line_end [--payload SHARE] [--draws N] [--first SEED] [--lines N...]
[ROBOT...]``
drives the realistic robots, with the plain ones believed and with what an identification may find of the
true ones; `corrected`, and `seen` where a camera has looked at the robot at rest before.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import DiagramBuilder

from diagrams.runs.simulation import run
from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario
from experiments.feedforward.identified_beliefs import believed
from experiments.feedforward.rectangle import (
    LAW,
    RectangleTrial,
    feasible_pace,
    rectangle,
    rectangle_scenario,
    working_position,
)
from robots.description.model import NUM_JOINTS, RobotModel, load_robot
from robots.kinematics.forward import Kinematics
from systems.feedforward import FeedforwardConfig
from systems.feedforward.predictive.config import PredictiveConfig
from systems.feedforward.predictive.correction import PredictiveCorrection
from systems.reference.reference import Reference
from systems.reference.shapes import Rectangle
from systems.samples import JointSample

_SETTLE, _DWELL = 1.0, 0.6  # s at rest: the arm is first wound up, then comes to rest
_JUST_AFTER = 0.2  # s
_TIMED = 600  # ticks
_BEHIND, _WAVES = 1e-4, 20.0  # rad and rad/s: how motors stray while a tick is timed
_EDGES = 4
_ROBOTS = ("kr16", "kr210")
KIND, CORRECTED = "elastic_structure", "corrected"  # of inverse models
# With what an identification may find: label, inverse model, predictive correction, where links may rest
_LABELLED = (
    ("alone", KIND, "none", "anywhere"),
    ("corrected", CORRECTED, "motors", "anywhere"),
    ("seen", CORRECTED, "motors", "seen"),
)
_DRAWS = 4  # of what an identification may find
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
    path: Rest  # of the true tip from the end of its path


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
    gap = tip - log.X_WE_desired[after, :3, 3]
    return LineEnd(_rest(motors - wanted, soon), _rest(tip - tip[-1], soon), _rest(gap, soon))


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
    """Without and with the predictive correction of the motors, with the largest payload.

    Args:
        name: of the robot that the controller believes in.
        plant: of the true one; None for its realistic variant.
    """
    true = load_robot(plant or f"{name}-realistic")
    without, corrected = (trial(load_robot(name), true, KIND, kind) for kind in ("none", "motors"))
    return without, corrected


def trial(
    believed: RobotModel,
    true: RobotModel,
    kind: str,
    predictive: str,
    share: float = 1.0,
    resting: str = "anywhere",
) -> RectangleTrial:
    """A trial with a share of the largest payload.

    Args:
        believed: the robot of the controller.
        true: the one in the station.
        kind: of the inverse model.
        predictive: kind of the predictive correction beside it.
        share: of the largest payload.
        resting: whether a camera looks first, see `FeedforwardConfig`.
    """
    config = FeedforwardConfig(kind, resting=resting, predictive=PredictiveConfig(predictive))
    return RectangleTrial(believed, share * true.payload.largest_mass, config, true)


def rows(
    name: str,
    share: float = 1.0,
    draws: Sequence[int] = range(1, _DRAWS + 1),
    edges: Sequence[int] = range(_EDGES),
) -> Iterator[str]:
    """A line of text for each edge, belief and inverse model, the worst of the draws, the time of a tick."""
    true = load_robot(f"{name}-realistic")
    plain = load_robot(name)
    for edge in edges:
        for label, kind in (("alone", "none"), ("motors", "motors")):
            yield _row(name, edge, "plain", label, _values(trial(plain, true, KIND, kind, share), edge))
        worst = {}
        for draw in draws:
            belief = believed(true, draw)
            for label, kind, beside, resting in _LABELLED:
                values = _values(trial(belief, true, kind, beside, share, resting), edge)
                worst[label] = np.maximum(worst.get(label, 0.0), values)
                yield _row(name, edge, f"draw {draw}", label, values)
        for label, values in worst.items():
            yield _row(name, edge, "worst", label, values)
    yield f"{name:6} a tick of the correction {1e3 * tick_time(trials(name)[1]):.2f} ms"


def _values(trial: RectangleTrial, edge: int) -> np.ndarray:
    found = line_end(trial, line_scenario(trial, edge))
    return np.array(
        [[each.largest, each.effective] for each in (found.motors, found.tip, found.path)]
    ).ravel()


def _row(name: str, edge: int, belief: str, label: str, values: np.ndarray) -> str:
    text = "".join(f"{1e3 * value:9.3f}" for value in values)
    return f"{name:6} line {edge + 1} {belief:7} {label:10} {text} mm"


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("robots", nargs="*", default=_ROBOTS)
    parser.add_argument("--payload", type=float, default=1.0, help="share of the largest one")
    parser.add_argument("--draws", type=int, default=_DRAWS, help="of what an identification may find")
    parser.add_argument("--first", type=int, default=1, help="seed of the first draw")
    parser.add_argument("--lines", nargs="*", type=int, default=range(1, _EDGES + 1), help="1 to 4")
    chosen = parser.parse_args()
    print(f"{'largest and effective':30}{'of the motors':>18}{'of the tip':>18}{'from its path':>18}")
    for robot in chosen.robots:
        draws = range(chosen.first, chosen.first + chosen.draws)
        for row in rows(robot, chosen.payload, draws, [line - 1 for line in chosen.lines]):
            print(row, flush=True)
