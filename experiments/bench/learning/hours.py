"""The self-calibrating law for hours: ``python -m experiments.bench.learning.hours [HOURS] [SEED]``.

In the scenario `everything` the tool goes from rest to rest along lines between random poses, each tilted by
up to 15 degrees, and never the same way twice. For each part of the time a row says how far the true tip was
from the path in motion and at rest, how well the law knows it, what its ticks cost and how much memory the
process has. Errors that grow, an estimate that freezes or memory that is not given back would show. An hour
takes about half an hour on one core; a row is printed when its part is over.
"""

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import psutil

from diagrams.record.log import RunLog
from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import Scenario, load_scenario
from experiments.metrics.run_metrics import pose_errors
from robots.description.model import RobotModel, load_robot
from robots.dynamics.newton_inverse import inverse_kinematics
from systems.reference.paths import make_path
from systems.reference.shapes import Points, Waypoint

LAW = "self_calibrating"
HOURS, PARTS_AN_HOUR = 1.0, 6
REST = 0.4  # s, at each pose
_LEAST, _MOST = np.array([380.0, -350.0, 320.0]), np.array([540.0, 350.0, 480.0])  # mm, of the poses
_TILT = 15.0  # degrees, about each axis
_TURN = 0.2  # degrees a mm, by which the tool turns with the arm as it swings to the side
_WRIST = 0.3  # rad, the least that joint 5 is bent: nearer to its singularity no robot keeps its speed
_SPEED = 0.8  # of the largest speed of a joint, on the way
_SETTLED = 0.2  # s, after which a tool that has come to a pose is called at rest
_STEP = 0.05  # s, between the poses of a line that are tried


@dataclass(frozen=True)
class Part:
    """What was seen over a part of the time."""

    until: float  # s, of the run
    in_motion: float  # m, largest distance of the true tip from the path
    angle: float  # rad
    rms: float  # m
    at_rest: float  # m
    coverage: float  # share of the predictions whose 95 % ellipsoid holds the true tip
    ticks: np.ndarray  # s, of wall time
    memory: int  # bytes


def random_waypoints(robot: RobotModel, scenario: Scenario, count: int, seed: int) -> list[Waypoint]:
    """Poses that the nominal robot reaches one after the other on straight lines, none of them singular.

    Args:
        robot: as it is drawn in its file.
        scenario: says how fast the lines are run, and where the robot is before.
        count: of poses.
        seed: of the draw.
    """
    rng, inverse = np.random.default_rng(seed), inverse_kinematics(robot)
    q = inverse.along(make_path(scenario.reference).sample(np.zeros(1))[0], np.deg2rad(scenario.home_deg))[0]
    found: list[Waypoint] = []
    while len(found) < count:
        position = rng.uniform(_LEAST, _MOST)
        tilts = rng.uniform(-_TILT, _TILT, 3)
        drawn = Waypoint(position, np.array([90.0 + _TURN * position[1], 0.0, 90.0]) + tilts)
        line = Points([found[-1] if found else drawn, drawn])
        path = make_path(replace(scenario.reference, path=line, settle=0.0, dwell=0.0, laps=1))
        times = np.arange(0.0, path.duration, _STEP)
        try:
            along = inverse.along(path.sample(times)[0], q)
        except ValueError:
            continue
        speeds = np.abs(np.diff(along, axis=0)) / _STEP
        if (speeds < _SPEED * robot.speed).all() and np.abs(along[:, 4]).min() > _WRIST:
            found.append(drawn)
            q = along[-1]
    return found


def hours_scenario(hours: float, seed: int) -> Scenario:
    """The scenario `everything` with a path of so many hours, and a robot of that seed."""
    drawn = [f"{name}={seed}" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    scenario = load_scenario("everything", drawn)
    reference = replace(scenario.reference, dwell=REST, laps=1)
    pair = make_path(replace(reference, path=Points([Waypoint(), Waypoint()]), settle=0.0))
    count = math.ceil(3600.0 * hours / pair.duration) + 1
    points = random_waypoints(load_robot(scenario.robot), scenario, count, seed)
    return replace(scenario, reference=replace(reference, path=Points(points)))


def parts(scenario: Scenario, seconds: float) -> Iterator[Part]:
    """Runs the law; a part of so many seconds after the other."""
    experiment, process = Experiment(scenario, LAW), psutil.Process()
    end = experiment.path.duration
    until = experiment.path.path_start
    while until < end:
        until = min(until + seconds, end)
        experiment.advance(until)
        log = experiment.log()
        experiment.forget()
        yield seen(log, process.memory_info().rss)


def seen(log: RunLog, memory: int) -> Part:
    """What a part of the record says."""
    on_path = log.time >= log.path_start
    errors = pose_errors(log, "true")[on_path]
    distance, angle = np.linalg.norm(errors[:, 3:], axis=1), np.linalg.norm(errors[:, :3], axis=1)
    rests = resting(log.X_WE_desired[on_path], log.time[on_path])
    return Part(
        until=float(log.time[-1]),
        in_motion=float(distance.max()),
        angle=float(angle.max()),
        rms=float(np.sqrt(np.mean(distance**2))),
        at_rest=float(distance[rests].max()) if rests.any() else np.nan,
        coverage=log.learnt["coverage"]["share"] if log.learnt else np.nan,
        ticks=np.asarray(log.tick_seconds),
        memory=memory,
    )


def resting(X_WE_desired: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Where the path has rested for long enough to call the tool at rest, bool (n,)."""
    moves = np.ones(len(times), dtype=bool)
    moves[1:] = np.abs(np.diff(X_WE_desired, axis=0)).max(axis=(1, 2)) > 1e-12
    last = np.maximum.accumulate(np.where(moves, times, -np.inf))
    return times - last > _SETTLED


def main(hours: float, seed: int) -> None:
    """Prints a row for each part of the time."""
    scenario = hours_scenario(hours, seed)
    head = "   until   mm in motion   degrees      rms   mm at rest   coverage   tick us, 99.9 %, max    MB"
    print(head, flush=True)
    for part in parts(scenario, 3600.0 / PARTS_AN_HOUR):
        ticks = 1e6 * np.quantile(part.ticks, [0.5, 0.999, 1.0])
        print(
            f"{part.until:7.0f} s {1e3 * part.in_motion:12.4f} {np.rad2deg(part.angle):9.4f} "
            f"{1e3 * part.rms:8.4f} {1e3 * part.at_rest:12.4f} {part.coverage:10.3f} "
            f"{ticks[0]:9.0f} {ticks[1]:7.0f} {ticks[2]:6.0f} {part.memory / 2**20:6.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else HOURS, int(sys.argv[2]) if len(sys.argv) > 2 else 1)
