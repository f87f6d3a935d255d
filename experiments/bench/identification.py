"""Benchmark of identifications and of designs for them: processor time against what is allowed.

Alone: ``python -m experiments.bench.identification``.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from robots.calibration.identification import IdentificationConfig, identify
from robots.calibration.instruments.identify import identify_with_instruments
from robots.calibration.instruments.observations import Observations
from robots.calibration.measurements import SOURCE_NOISE, Measurements
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import RobotModel, load_robot
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations
from robots.measurement_design.design import design_measurements

POSES, POSITIONS = 75, 1000
PLACES = np.array([[0.0, 0.0, 0.1], [0.08, 0.0, 0.05], [0.0, -0.07, 0.12]])  # m, of three targets in the tool
TRACKER = np.array([3.0, -2.0, 1.5])  # m, the world of the robot in the tracker's frame
TRACKER_NOISE, GROSS = 5e-5, 0.02  # m
BAD_ROWS = [5, 20, 40]
ALLOWED = {"known": 50.0, "estimated": 100.0, "robust": 500.0, "targets": 2000.0}  # ms
REPEATS = 5
DESIGNED = ("irb1200", "irb140", "kr16", "puma560", "ur10")
DESIGN_ALLOWED = 10.0  # s

Row = tuple[str, str, float, str, float, str]  # name, what it is, value, unit, yardstick, what that is


def identification() -> Iterator[Row]:
    """Poses with known and with estimated noise and with gross errors, and positions of three targets."""
    robot, rng = load_robot("irb1200"), np.random.default_rng(0)
    table = _poses(robot, rng)
    position = table.position.copy()
    position[BAD_ROWS] += GROSS
    damaged = replace(table, position=position)
    lines = _lines(robot, rng)
    known = IdentificationConfig(noise=SOURCE_NOISE)
    estimated = IdentificationConfig(search_outliers=False)
    poses = f"identification of {POSES} poses"
    cases: dict[str, tuple[str, Callable[[], object]]] = {
        "known": (f"{poses}, known noise", lambda: identify(robot, table, known)),
        "estimated": (f"{poses}, estimated noise", lambda: identify(robot, table, estimated)),
        "robust": (f"{poses}, gross errors", lambda: identify(robot, damaged)),
        "targets": (
            f"identification, {POSITIONS} x 3 targets",
            lambda: identify_with_instruments(robot, lines),
        ),
    }
    for name, (text, run) in cases.items():
        yield f"identification_{name}", text, _best(run), "ms", ALLOWED[name], "allowed"


def designs() -> Iterator[Row]:
    """Configurations to be measured, with the robot's own ranges, floor and arm; each once."""
    for number, name in enumerate(DESIGNED):
        robot = load_robot(name)
        admissible = AdmissibleConfigurations(robot, AdmissibleConfig())
        if number == 0:
            design_measurements(robot, admissible=admissible)  # compiles
        started = time.process_time()
        design = design_measurements(robot, admissible=admissible)
        spent = time.process_time() - started
        text = f"design of {POSES} poses, {name}, {design.value / design.bound:.2%} of its bound"
        yield f"design_{name}", text, spent, "s", DESIGN_ALLOWED, "allowed"


def _best(run: Callable[[], object]) -> float:
    """The least processor time in ms; the first run, which compiles, does not count."""
    run()
    spent = []
    for _ in range(REPEATS):
        started = time.process_time()
        run()
        spent.append(1e3 * (time.process_time() - started))
    return min(spent)


def _forward(robot: RobotModel, q: np.ndarray) -> np.ndarray:
    """Poses (n, 4, 4) of a robot that is 10 mm and some degrees off."""
    zeros = np.array([1.0, 3.5, 2.0, 1.5, 2.5, 3.0])
    wrong = GeometricErrors(zeros, np.full(3, 10.0), np.array([0.0, 0.0, 0.1]))
    return ErrorKinematics(robot).forward(q, wrong.vector(robot))


def _poses(robot: RobotModel, rng: np.random.Generator) -> Measurements:
    q = rng.uniform(robot.lower, robot.upper, (POSES, 6))
    X = _forward(robot, q)
    return Measurements(q, X[:, :3, 3], X[:, :3, :3]).noisy(SOURCE_NOISE, rng)


def _lines(robot: RobotModel, rng: np.random.Generator) -> Observations:
    """What a tracker at a place of its own says of three targets, a line each."""
    q = rng.uniform(robot.lower, robot.upper, (POSITIONS, 6))
    X = _forward(robot, q)
    seen = np.einsum("nij,tj->nti", X[:, :3, :3], PLACES) + X[:, None, :3, 3] + TRACKER
    seen = seen + TRACKER_NOISE * rng.normal(size=seen.shape)
    count = POSITIONS * len(PLACES)
    unknown = np.full(count, np.nan)
    return Observations(
        q=q,
        row=np.repeat(np.arange(POSITIONS), len(PLACES)),
        target=np.tile(np.arange(len(PLACES)), POSITIONS),
        instrument=np.zeros(count, dtype=int),
        position=seen.reshape(-1, 3),
        distance=unknown,
        sigma=unknown,
        lines=np.arange(2, count + 2),
        targets=("a", "b", "c"),
        instruments=("tracker",),
    )


if __name__ == "__main__":
    for rows in (identification(), designs()):
        for _, text, value, unit, allowed, _ in rows:
            print(f"{text}: {value:.3g} {unit}, allowed {allowed:.3g} {unit}")
