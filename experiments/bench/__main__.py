"""Cost and accuracy as ratios measured in one run on one core: ``python -m experiments.bench``.

The closed loop is compared with the bare plant and its drives making the same motion, the kinematics with
Drake's forward kinematics and Jacobian of one configuration after the other, the rest with what is required.
Prints a table and writes ``bench.json``: ``{name: {"value", "unit", "yardstick", "ratio"}}`` with ratio =
value / yardstick. What is timed is timed three times and the best counts, for value and yardstick alike.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator
from itertools import chain

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from rich import box
from rich.console import Console
from rich.table import Table

from diagrams.record.log import RunLog
from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import Scenario, load_scenario
from experiments.bench.bare import BarePlant
from experiments.bench.cameras import cameras
from experiments.bench.exact import EXACT
from experiments.bench.feedforward import feedforward
from experiments.bench.identification import designs, identification
from experiments.bench.images import images
from experiments.bench.learning.ticks import learning
from experiments.bench.tracking import tracking
from experiments.bench.wire import wire
from experiments.comparison.compare import compared_laws
from experiments.report.files import write_json
from robots.description.model import RobotModel, load_robot
from robots.dynamics.plant import add_robot
from robots.kinematics.analytic_inverse import InverseKinematics
from robots.kinematics.forward import Kinematics
from robots.measurement_design.constraints import AdmissibleConfigurations
from robots.measurement_design.design import design_measurements

REPEATS = 3
SETTLE, SPAN = 0.5, 4.0  # s: standing at the start, then the first edge of the rectangle
SAME_MOTION = 1e-7  # rad, between the closed loop and the bare plant
REQUIRED_REAL_TIME = {7: 6.0, 0: 3.0}  # by the load in kg
CONFIGURATIONS, DRAKE_CONFIGURATIONS, POSES = 100_000, 2_000, 2_000
REQUIRED_CONVERGENCE = 1.0  # um
REQUIRED_B3, REQUIRED_DESIGN_TIME = 3.34, 5.0  # the time in s

Row = tuple[str, str, float, str, float, str]  # name, what it is, value, unit, yardstick, what that is


def main() -> None:
    """Runs all benchmarks; the first argument is where the JSON goes, by default ``bench.json``."""
    path = sys.argv[1] if len(sys.argv) > 1 else "bench.json"
    # What goes to a file must not be cut to the 80 columns that a terminal is thought to have.
    console, started = Console(width=None if sys.stdout.isatty() else 120), time.perf_counter()
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("benchmark", no_wrap=True)
    for title in ("value", "yardstick", "ratio"):
        table.add_column(title, justify="right", no_wrap=True)
    result = {}
    with console.status("Measuring") as status:
        for name, text, value, unit, yardstick, yardstick_text in chain(_on_one_core(benchmarks()), wire()):
            ratio = value / yardstick
            result[name] = {"value": value, "unit": unit, "yardstick": yardstick, "ratio": ratio}
            against = f"{yardstick_text} {yardstick:.3g} {unit}"
            table.add_row(text, f"{value:.3g} {unit}", against, f"{ratio:.3g}")
            status.update(f"Measuring, {len(result)} done")
    console.print(table)
    write_json(path, result)
    console.print(f"{path}, measured in {time.perf_counter() - started:.0f} s")


def _on_one_core(rows: Iterator[Row]) -> Iterator[Row]:
    """The same rows, measured on one core; what runs in real time beside other processes needs more."""
    if not hasattr(os, "sched_getaffinity"):
        yield from rows
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    try:
        yield from rows
    finally:
        os.sched_setaffinity(0, cores)


def benchmarks() -> Iterator[Row]:
    """All benchmarks of one process in turn."""
    robot = load_robot(load_scenario("misaligned").robot)
    for law in compared_laws():
        yield from closed_loop(law, robot)
    yield from kinematics(robot)
    yield from design(robot)
    yield from identification()
    yield from designs()
    yield from feedforward()
    yield from tracking()
    yield from images()
    yield from cameras()
    yield from learning()
    for law in compared_laws():
        yield convergence(law, robot)


def closed_loop(law: str, robot: RobotModel) -> Iterator[Row]:
    """Wall time against the bare plant, and real-time factors with and without load."""
    for load, required in REQUIRED_REAL_TIME.items():
        scenario = load_scenario("misaligned", [f"reference.settle={SETTLE}", f"station.payload={load}"])
        closed, log = _time_closed_loop(scenario, law, robot)
        if load > 0:
            bare = _time_bare(scenario, law, robot, log)
            for _ in range(REPEATS - 1):  # in turn, so that a busy moment of the machine meets both
                closed = min(closed, _time_closed_loop(scenario, law, robot)[0])
                bare = min(bare, _time_bare(scenario, law, robot, log))
            text = f"{law}: wall time"
            yield f"closed_loop_{law}", text, closed / SPAN, "s/s", bare / SPAN, "bare"
        else:
            closed = min([closed, *(_time_closed_loop(scenario, law, robot)[0] for _ in range(REPEATS - 1))])
        text = f"{law}: real time, {load} kg"
        yield f"real_time_{law}_{load}kg", text, SPAN / closed, "", required, "required"


def _time_closed_loop(scenario: Scenario, law: str, robot: RobotModel) -> tuple[float, RunLog]:
    experiment = Experiment(scenario, law, robot)
    seconds = _seconds(lambda: experiment.advance(until=SPAN))
    return seconds, experiment.log()


def _time_bare(scenario: Scenario, law: str, robot: RobotModel, log: RunLog) -> float:
    bare = BarePlant(Experiment(scenario, law, robot), robot, log)
    last = float(log.time[-1])
    seconds = _seconds(lambda: bare.advance(last)) * SPAN / last
    difference = float(np.abs(bare.link_positions() - log.link_position[-1]).max())
    if difference > SAME_MOTION:
        raise RuntimeError(f"{law}: the bare plant moved differently, by {difference:.1e} rad at the end")
    return seconds


def kinematics(robot: RobotModel) -> Iterator[Row]:
    """Batch forward kinematics with Jacobian, and the inverse, against Drake one configuration at a time."""
    model, inverse = Kinematics(robot), InverseKinematics(robot)
    rng = np.random.default_rng(0)
    lower, upper = robot.lower, robot.upper
    q = rng.uniform(lower, upper, (CONFIGURATIONS, 6))
    batch = min(_seconds(lambda: model.forward_and_jacobian(q)) for _ in range(REPEATS))
    drake = _drake_kinematics(robot, q[:DRAKE_CONFIGURATIONS])
    each = min(_seconds(drake) for _ in range(REPEATS)) / DRAKE_CONFIGURATIONS
    yield (
        "kinematics_batch",
        f"kinematics, {CONFIGURATIONS} poses",
        batch,
        "s",
        each * CONFIGURATIONS,
        "Drake",
    )
    q_near = q[:POSES]
    X_WE = model.forward(q_near)
    pairs = list(zip(X_WE, q_near, strict=True))

    def solve() -> None:
        for X, near in pairs:
            inverse.nearest(X, near)

    nearest = min(_seconds(solve) for _ in range(REPEATS)) / POSES
    text = "inverse kinematics"
    yield "inverse_nearest", text, 1e6 * nearest, "us", 1e6 * each, "Drake"


def _drake_kinematics(robot: RobotModel, q: np.ndarray) -> Callable[[], None]:
    plant = MultibodyPlant(0.0)
    tool = add_robot(plant, robot, "rigid").tool
    plant.Finalize()
    context, world = plant.CreateDefaultContext(), plant.world_frame()

    def calculate() -> None:
        for one in q:
            plant.SetPositions(context, one)
            tool.CalcPoseInWorld(context)
            plant.CalcJacobianSpatialVelocity(
                context, JacobianWrtVariable.kQDot, tool, np.zeros(3), world, world
            )

    return calculate


def design(robot: RobotModel) -> Iterator[Row]:
    """The choice of 75 configurations, against what is required."""
    admissible = AdmissibleConfigurations(robot)
    started = time.perf_counter()
    found = design_measurements(robot, admissible=admissible)
    seconds = time.perf_counter() - started
    yield "design_b3", "design of 75, B3", found.value, "", REQUIRED_B3, "required"
    yield "design_time", "design of 75, time", seconds, "s", REQUIRED_DESIGN_TIME, "allowed"


def convergence(law: str, robot: RobotModel) -> Row:
    """The largest distance of the tip from the one integrated exactly, with the camera's noise."""
    settings = [f"reference.settle={SETTLE}"]
    tips = []
    for _ in range(2):
        experiment = Experiment(load_scenario("misaligned", settings), law, robot)
        experiment.advance(until=SPAN)
        tips.append(experiment.log().X_WE_true[:, :3, 3])
        settings += EXACT[experiment.integration.scheme]
    difference = 1e6 * float(np.linalg.norm(tips[0] - tips[1], axis=1).max())
    text = f"{law}: integration error"
    return f"convergence_{law}", text, difference, "um", REQUIRED_CONVERGENCE, "required"


def _seconds(work: Callable[[], object]) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
