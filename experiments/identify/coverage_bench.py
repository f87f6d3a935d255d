"""Benchmark of identifications from starts that are far off: errors, and whether intervals hold the truth.

``python -m experiments.identify.coverage_bench 50 out/coverage.jsonl [FIRST]``: so many robots, each with
springs, dampers and noise of its own, 18 motions of the realistic plant each, believed to be by a factor of
two too stiff or too soft in every spring. A line a robot goes into the file; those that are there are not
done again.
"""

import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.identify.cases import default_cases
from experiments.identify.recording_map import Recording
from experiments.identify.simulated import simulated_recording
from experiments.identify.study import IdentifyStudy, study_recording
from robots.description.drive_parts import Backlash
from robots.description.model import RobotModel, load_robot
from robots.description.variation import Factors, varied

ROBOT, SPREAD, TIMES = "kr210", 0.2, 0.4  # logarithms of springs and of retardation times, either way
OFF = 2.0  # times
WITHIN = 1.96  # standard deviations
KINDS = {"stiffness_": 0.03, "damping_": 0.25}  # allowed errors


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


def identified(seed: int, recording: Recording | None = None) -> tuple[IdentifyStudy, RobotModel]:
    """One robot, recorded and identified."""
    rng = np.random.default_rng(seed)
    nominal = load_robot(ROBOT)
    plant = drawn(load_robot(f"{ROBOT}-realistic"), rng)
    believed = far(nominal, rng)
    # Simulated under the nominal feedforward: it excites alike whatever is believed.
    recording = recording or simulated_recording(nominal, plant, default_cases(nominal), seed, processes=1)
    return study_recording(believed, plant, recording), plant


def line(seed: int, study: IdentifyStudy) -> dict:
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
    return {"seed": seed, "seconds": study.seconds, "parameters": rows}


def report(lines: list[dict]) -> None:
    """Prints what all robots say."""
    for kind, allowed in KINDS.items():
        rows = [row for each in lines for row in each["parameters"] if row["name"].startswith(kind)]
        known = [row for row in rows if row["identifiable"]]
        inside = [abs(row["error"]) < WITHIN * row["sigma"] for row in rows]
        errors = np.abs([row["error"] for row in known])
        worst = f"worst {errors.max():.1%}, median {np.median(errors):.1%}" if known else "none known"
        print(
            f"{kind.rstrip('_')}: {len(known)} of {len(rows)} known, {worst} ({allowed:.0%}); "
            f"{np.mean(inside):.2f} of 95 % intervals hold the truth (0.90 to 0.99), {len(lines)} robots"
        )


def main(robots: int, path: Path, first: int) -> None:
    """Does what is not there, then reports."""
    lines = [json.loads(text) for text in path.read_text().splitlines()] if path.exists() else []
    done = {each["seed"] for each in lines}
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in range(first, first + robots):
        if seed in done:
            continue
        started = time.process_time()
        study, _ = identified(seed)
        lines.append(line(seed, study))
        with path.open("a") as file:
            file.write(json.dumps(lines[-1]) + "\n")
        print(f"robot {seed}: {time.process_time() - started:.0f} CPU s", flush=True)
        report(lines[-1:])
    report(lines)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    main(int(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 0)
