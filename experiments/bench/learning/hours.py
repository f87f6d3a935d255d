"""The self-calibrating law for hours: ``python -m experiments.bench.learning.hours [HOURS] [SEED]``.

In the scenario `everything` the tool goes from rest to rest along lines between random poses, each tilted by
up to 15 degrees, and never the same way twice. For each part of the time a row says how far the true tip was
from the path in motion and at rest, how well the law knows it, what its ticks cost and how much memory the
process has. Errors that grow, an estimate that freezes or memory that is not given back would show. An hour
takes about half an hour on one core; a row is printed when its part is over. With ``--state`` what there is
then is written to a file, and a run that was ended goes on from there, with other noise of the camera.
"""

import argparse
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

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


def hours_scenario(hours: float, seed: int, max_step: float | None = None) -> Scenario:
    """The scenario `everything` with a path of so many hours, and a robot of that seed.

    Args:
        hours: of the path, or a little more.
        seed: of the robot and of the path.
        max_step: of the integrator in s; None for the one that makes it right to less than a micrometre.
    """
    drawn = [f"{name}={seed}" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    scenario = load_scenario("everything", drawn)
    reference = replace(scenario.reference, dwell=REST, laps=1)
    pair = make_path(replace(reference, path=Points([Waypoint(), Waypoint()]), settle=0.0))
    count = math.ceil(3600.0 * hours / (pair.duration - REST)) + 1  # it rests at the first of two, too
    points = random_waypoints(load_robot(scenario.robot), scenario, count, seed)
    return replace(
        scenario,
        reference=replace(reference, path=Points(points)),
        integrator=replace(scenario.integrator, max_step=max_step),
    )


def parts(scenario: Scenario, seconds: float, state: Path | None = None) -> Iterator[Part]:
    """Runs the law; a part of so many seconds after the other.

    Args:
        scenario: what to run.
        seconds: of each part.
        state: a file that keeps the end of the last part; if it is there, the run goes on from it.
    """
    process = psutil.Process()
    if state and state.exists():
        experiment = resumed(scenario, state)
        until = experiment.context.get_time()
    else:
        experiment = Experiment(scenario, LAW)
        until = experiment.path.path_start
    end = experiment.path.duration
    while until < end:
        until = min(until + seconds, end)
        experiment.advance(until)
        log = experiment.log()
        experiment.forget()
        if state:
            keep(experiment, state)
        yield seen(log, process.memory_info().rss)


def keep(experiment: Experiment, state: Path) -> None:
    """Writes to a file where an experiment stands: time, continuous and discrete state."""
    context = experiment.context
    groups = [context.get_discrete_state(i).value() for i in range(context.num_discrete_state_groups())]
    x, discrete = context.get_continuous_state_vector().CopyToVector(), np.concatenate(groups)
    written = state.with_suffix(".part")
    with written.open("wb") as file:  # as a whole or not at all
        np.savez(file, of=_identity(experiment), time=context.get_time(), continuous=x, discrete=discrete)
    written.replace(state)


def _identity(experiment: Experiment) -> list[float]:
    """What has to be alike for a state to fit: seed and length of the path, and the sizes of the state."""
    context = experiment.context
    sizes = [context.get_discrete_state(i).size() for i in range(context.num_discrete_state_groups())]
    return [experiment.scenario.seed, experiment.path.duration, context.num_continuous_states(), *sizes]


def resumed(scenario: Scenario, state: Path) -> Experiment:
    """An experiment that goes on where `keep` left it; only the camera's noise is drawn from another seed.

    Raises:
        ValueError: if the state is that of another robot, of another path, or of another version.
    """
    with np.load(state) as kept:
        time = float(kept["time"])
        experiment = Experiment(scenario, LAW, seed=scenario.seed + 1 + round(time))
        identity, context = _identity(experiment), experiment.context
        if not np.array_equal(kept["of"], identity):
            raise ValueError(f"{state} was kept with other hours, another seed or another version of truetip")
        context.SetTime(time)
        context.SetContinuousState(kept["continuous"])
        groups = np.split(kept["discrete"], np.cumsum(identity[3:]).astype(int)[:-1])
    for i, group in enumerate(groups):
        context.SetDiscreteState(i, group)
    experiment.simulator.Initialize()
    experiment.forget()  # what the record shows of the start
    return experiment


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


def main() -> None:
    """Prints a row for each part of the time."""
    parser = argparse.ArgumentParser(description="The self-calibrating law for hours.")
    parser.add_argument("hours", type=float, nargs="?", default=HOURS)
    parser.add_argument("seed", type=int, nargs="?", default=1)
    parser.add_argument("--state", type=Path, help="keeps where the run stands; goes on from there")
    parser.add_argument("--max-step", type=float, help="of the integrator in s")
    args = parser.parse_args()
    scenario = hours_scenario(args.hours, args.seed, args.max_step)
    head = "   until   mm in motion   degrees      rms   mm at rest   coverage   tick us, 99.9 %, max    MB"
    print(head, flush=True)
    for part in parts(scenario, 3600.0 / PARTS_AN_HOUR, args.state):
        ticks = 1e6 * np.quantile(part.ticks, [0.5, 0.999, 1.0])
        print(
            f"{part.until:7.0f} s {1e3 * part.in_motion:12.4f} {np.rad2deg(part.angle):9.4f} "
            f"{1e3 * part.rms:8.4f} {1e3 * part.at_rest:12.4f} {part.coverage:10.3f} "
            f"{ticks[0]:9.0f} {ticks[1]:7.0f} {ticks[2]:6.0f} {part.memory / 2**20:6.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
