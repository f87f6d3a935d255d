"""Benchmark of the fine tuning: what it gains on a robot that was identified, or on one that was not.

``python -m experiments.identify.fine_tuning.bench ROBOT PLANT [IDENTIFY.json] [--share K] [--seed N]``:
the robot as it is believed to be and what is driven, by name or file, and what ``truetip identify --json``
has written of the first one, from which standard deviations are; without it nothing is known.
"""

import argparse
import json
from dataclasses import replace

from experiments.cli.workers import LocalProcesses, Progress, in_order
from experiments.feedforward.rectangle import RectangleTrial
from experiments.identify.fine_tuning.report import (
    MOTIONS_HEAD,
    NUMBERS_HEAD,
    fine_tuning_json,
    motion_rows,
    number_rows,
    outcome,
)
from experiments.identify.fine_tuning.tuning import SHARE, fine_tune
from robots.description.model import load_robot
from robots.identification.identified_robot import FoundParameter
from systems.feedforward import FeedforwardConfig


def found_in(file: str) -> list[FoundParameter]:
    """The parameters in the JSON of an identification."""
    with open(file, encoding="utf-8") as stream:
        rows = json.load(stream)["parameters"]
    return [
        FoundParameter(name, row["unit"], row["value"], row["sigma"], row["identifiable"])
        for name, row in rows.items()
    ]


def _integral(trial: RectangleTrial, progress: Progress) -> float:
    return trial.run(progress).integral


def main() -> None:
    """Tunes, and drives the rectangle of `truetip feedforward` with rigid, former and tuned inverse."""
    parser = argparse.ArgumentParser()
    parser.add_argument("robot")
    parser.add_argument("plant")
    parser.add_argument("identified", nargs="?")
    parser.add_argument("--share", type=float, default=SHARE)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=None)
    parser.add_argument("--json")
    given = parser.parse_args()
    robot, plant = load_robot(given.robot), load_robot(given.plant)
    payload, executor = robot.payload.largest_mass, LocalProcesses(given.jobs)
    found = found_in(given.identified) if given.identified else []
    tuning = fine_tune(robot, plant, payload, executor, found, given.share, seed=given.seed)
    for row in [MOTIONS_HEAD, *motion_rows(tuning), NUMBERS_HEAD, *number_rows(tuning)]:
        print("".join(f"{cell:>22}" for cell in row))
    print(outcome(tuning))
    rigid = RectangleTrial(robot, payload, FeedforwardConfig("rigid", rough_path="accept"), plant)
    elastic = replace(rigid, config=replace(rigid.config, kind="elastic_structure"))
    trials = [rigid, elastic, replace(elastic, robot=tuning.candidate)]
    of_rigid, before, after = in_order(executor, _integral, trials)
    print(f"rectangle, of rigid: {before / of_rigid:.4f} before, {after / of_rigid:.4f} tuned")
    if given.json:
        with open(given.json, "w", encoding="utf-8") as stream:
            json.dump(fine_tuning_json(tuning) | {"rectangle": [before / of_rigid, after / of_rigid]}, stream)


if __name__ == "__main__":
    main()
