"""Benchmark of identifications from starts that are far off: errors, and whether intervals hold the truth.

``python -m experiments.identify.coverage_bench ROBOTS DRAWS out/coverage.jsonl [FIRST]``: so many robots,
each with springs and dampers of its own, 18 motions of the realistic plant each. The motions are recorded
once a robot, without noise, into a folder beside the file; each draw adds noise, a clock and beliefs of its
own, by a factor of two too stiff or too soft in every spring. A line a draw goes into the file; what is there
is not done again.
"""

import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.cli.workers import LocalProcesses
from experiments.identify.cases import default_cases
from experiments.identify.recording_file import read_recording, write_recording
from experiments.identify.recording_map import Recording
from experiments.identify.simulated import places, simulated_recording
from experiments.identify.study import IdentifyStudy, study_recording
from robots.description.drive_parts import Backlash
from robots.description.model import RobotModel, load_robot
from robots.description.variation import Factors, varied

ROBOT, SPREAD, TIMES = "kr210", 0.2, 0.4  # logarithms of springs and of retardation times, either way
OFF = 2.0  # times
OFFSET, DRIFT = 0.02, 2e-5  # s and relative, of the clock of the sensors, either way
WITHIN = 1.96  # standard deviations
KINDS = {"stiffness_": 0.03, "damping_": 0.25, "play_": 0.3, "hysteresis_": 0.3}  # allowed errors


def drawn(nominal: RobotModel, rng: np.random.Generator) -> RobotModel:
    """A robot with springs and retardation times of its own; the latter are the same in each group."""

    def spread(*size: int) -> np.ndarray:
        return np.exp(SPREAD * rng.uniform(-1.0, 1.0, size))

    robot = varied(nominal, Factors(spread(6), spread(6, 2), spread(6, 3)))
    gears, bearings = (np.exp(TIMES * rng.uniform(-1.0, 1.0, 2)).repeat(3) for _ in range(2))
    beams = float(np.exp(TIMES * rng.uniform(-1.0, 1.0)))
    joints = []
    for joint, gear, bearing in zip(robot.joints, gears.tolist(), bearings.tolist(), strict=True):
        train = replace(joint.drive_train, damping=gear * joint.drive_train.damping)
        if isinstance(train.backlash, Backlash):
            train = replace(
                train, backlash=replace(train.backlash, lubricant=gear * train.backlash.lubricant)
            )
        tilting = joint.tilting
        if tilting is not None:
            tilting = replace(tilting, damping=[bearing * value for value in tilting.damping])
        joints.append(replace(joint, drive_train=train, tilting=tilting))
    links = [
        link
        if link.beam is None
        else replace(link, beam=replace(link.beam, retardation_time=beams * link.beam.retardation_time))
        for link in robot.links
    ]
    return replace(robot, joints=joints, links=links)


def far(robot: RobotModel, rng: np.random.Generator) -> RobotModel:
    """Springs that are by a factor too stiff or too soft, by a coin each; dampers keep their ratio."""

    def coins(*size: int) -> np.ndarray:
        return OFF ** rng.choice([-1.0, 1.0], size=size)

    return varied(robot, Factors(coins(6), coins(6, 2), coins(6, 3)))


def recorded(seed: int, folder: Path) -> Recording:
    """The motions of one robot without noise, simulated or as they were kept.

    The sensors are read with the ticks of the robot: a clock of their own, which a draw gives them, would
    only cost steps of the integration. The feedforward is the nominal one: it excites alike whatever is
    believed.
    """
    path = folder / f"robot_{seed}.parquet"
    if not path.exists():
        nominal, motions = load_robot(ROBOT), default_cases(load_robot(ROBOT))
        sensors = places(motions.logger)
        motions.logger.clock_offset = motions.logger.clock_drift_ppm = 0.0
        for sensor in motions.logger.sensors:
            sensor.noise_sigma = 0.0
        found = simulated_recording(nominal, plant_of(seed), motions, seed, LocalProcesses(1))
        folder.mkdir(parents=True, exist_ok=True)
        write_recording(path, replace(found, sensors=sensors))
    return read_recording(path)


def plant_of(seed: int) -> RobotModel:
    """The robot of a seed."""
    return drawn(load_robot(f"{ROBOT}-realistic"), np.random.default_rng(seed))


def with_noise(recording: Recording, rng: np.random.Generator) -> Recording:
    """As sensors with noise and a clock of their own show it."""
    sigma = np.array([sensor.sigma for sensor in recording.sensors])[:, None]
    offset, drift = rng.uniform(-OFFSET, OFFSET), rng.uniform(-DRIFT, DRIFT)
    cases = [
        replace(
            case,
            stamps=(1.0 + drift) * case.stamps + offset,
            readings=case.readings + sigma * rng.normal(size=case.readings.shape),
        )
        for case in recording.cases
    ]
    return replace(recording, cases=cases)


def identified(seed: int, draw: int, recording: Recording) -> IdentifyStudy:
    """One robot, as one draw of noise and beliefs has it."""
    rng = np.random.default_rng([seed, draw])
    believed = far(load_robot(ROBOT), rng)
    return study_recording(believed, plant_of(seed), with_noise(recording, rng))


def line(seed: int, draw: int, study: IdentifyStudy, seconds: float) -> dict:
    """What is kept of one."""
    rows = [
        {
            "name": each.name,
            "error": each.value / each.true - 1.0,
            "sigma": each.sigma / each.value,
            "identifiable": each.identifiable,
        }
        for each in study.parameters
        if each.true and each.name.startswith(tuple(KINDS))
    ]
    return {"robot": seed, "draw": draw, "seconds": seconds, "parameters": rows}


def report(lines: list[dict]) -> None:
    """Prints what all robots say."""
    for kind, allowed in KINDS.items():
        rows = [row for each in lines for row in each["parameters"] if row["name"].startswith(kind)]
        if not rows:
            continue
        known = [row for row in rows if row["identifiable"]]
        inside = [abs(row["error"]) < WITHIN * row["sigma"] for row in rows]
        errors = np.abs([row["error"] for row in known])
        worst = f"worst {errors.max():.1%}, median {np.median(errors):.1%}" if known else "none known"
        print(
            f"{kind.rstrip('_')}: {len(known)} of {len(rows)} known, {worst} ({allowed:.0%}); "
            f"{np.mean(inside):.2f} of 95 % intervals hold the truth (0.90 to 0.99), {len(lines)} robots"
        )


def main(robots: int, draws: int, path: Path, first: int) -> None:
    """Does what is not there, then reports."""
    lines = [json.loads(text) for text in path.read_text().splitlines()] if path.exists() else []
    done = {(each["robot"], each["draw"]) for each in lines}
    folder = path.with_suffix(".recordings")
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in range(first, first + robots):
        recording = recorded(seed, folder)
        for draw in range(draws):
            if (seed, draw) in done:
                continue
            started = time.process_time()
            study = identified(seed, draw, recording)
            lines.append(line(seed, draw, study, time.process_time() - started))
            with path.open("a") as file:
                file.write(json.dumps(lines[-1]) + "\n")
            print(f"robot {seed}, draw {draw}: {lines[-1]['seconds']:.0f} CPU s", flush=True)
            report(lines[-1:])
    report(lines)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        raise SystemExit(__doc__)
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4]) if len(sys.argv) > 4 else 0)
