"""Benchmark of advice: what it proposes is simulated and added, and the identification done again.

``python -m experiments.identify.advice_bench ROBOTS out/advice.jsonl [FIRST]``: so many robots with springs
and dampers of their own, believed off by a factor of two. Six motions are recorded, with gyros on forearm and
hand and the accelerometers alone. What is proposed, for some weak parameters the best motion and the best
sensor, and a motion that should help least are then added, each for itself. A line a robot goes into the
file.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.cli.workers import LocalProcesses
from experiments.identify.advice.advise import Option, Prospects, advice_of
from experiments.identify.advice.candidates import candidate_sensors
from experiments.identify.cases import FurtherMotion, MotionCases, default_cases
from experiments.identify.coverage_bench import ROBOT, WITHIN, far, plant_of, with_noise
from experiments.identify.recording_map import Recording
from experiments.identify.simulated import places, simulated_recording
from experiments.identify.study import IdentifyStudy, study_recording
from robots.description.model import load_robot
from robots.identification.identified_robot import DAMPING_KNOWN, STIFFNESS_KNOWN
from robots.identification.motion import SensorPlace
from systems.cell.inertial_sensors import InertialSensorConfig

POSITIONS = slice(None, None, 6)  # of the eighteen motions: three positions, with both angles
HIDDEN = ("link_1", "link_2", "link_2_segment_4")  # bodies whose gyros the first recording has not
TRIED = 2  # weak parameters whose best motion and sensor are tried


class Robot:
    """One robot that moves as often as it is asked to, with all sensors."""

    def __init__(self, seed: int) -> None:
        self.seed, self.plant, self._rng = seed, plant_of(seed), np.random.default_rng([seed, 5])
        self.nominal = load_robot(ROBOT)
        self.believed = far(self.nominal, self._rng)
        self._plan = default_cases(self.nominal)
        self._plan.logger.clock_offset = self._plan.logger.clock_drift_ppm = 0.0
        self._shown = places(self._plan.logger)
        further = candidate_sensors(self.nominal, self._shown)
        for sensor in further:
            place = InertialSensorConfig(sensor.name, sensor.kind, sensor.body, sensor.position.tolist())
            self._plan.logger.sensors.append(place)
        for sensor in self._plan.logger.sensors:
            sensor.noise_sigma = 0.0
        self.sensors = self._shown + further
        starts = self._plan.starts(self.nominal)[POSITIONS]
        positions = [np.rad2deg(q).tolist() for q, _ in starts]
        self.first = self._moved(replace(self._plan, positions_deg=positions))

    def watched(self) -> Recording:
        """The first motions with the sensors that are there."""
        there = [s for s in self._shown if s.kind == "accelerometer" or s.body not in HIDDEN]
        return _with(self.first, there)

    def added(self, recording: Recording, options: Sequence[Option]) -> Recording:
        """With further motions and sensors."""
        sensors = list(recording.sensors)
        for option in options:
            if option.sensor is not None:
                there = (option.sensor.kind, option.sensor.body)
                sensors += [s for s in self.sensors if (s.kind, s.body) == there]
        found = _with(self.first, sensors)
        for number, option in enumerate(options):
            motion = option.motion
            if motion is None:
                continue
            position, angle = np.rad2deg(motion.start).tolist(), float(np.rad2deg(motion.angle))
            further = [FurtherMotion(position, angle, motion.payload)]
            moved = self._moved(replace(self._plan, angles_deg=[], further=further))
            case = replace(_with(moved, sensors).cases[0], name=f"further {number}")
            found = replace(found, cases=[*found.cases, case])
        return found

    def _moved(self, motions: MotionCases) -> Recording:
        found = simulated_recording(self.nominal, self.plant, motions, self.seed, LocalProcesses(1))
        return with_noise(replace(found, sensors=self.sensors), self._rng)


def _with(recording: Recording, sensors: list[SensorPlace]) -> Recording:
    """With some of the sensors only."""
    columns = [recording.sensors.index(sensor) for sensor in sensors]
    cases = [replace(case, readings=case.readings[:, columns]) for case in recording.cases]
    return replace(recording, cases=cases, sensors=sensors)


def tried(robot: Robot) -> list[dict]:
    """What was predicted, and what came out, for each trial and weak parameter."""
    recording = robot.watched()
    study = study_recording(robot.believed, robot.plant, recording)
    prospects = Prospects(robot.believed, study.payload, study.found, LocalProcesses(1))
    advice = advice_of(prospects, study.payload, study.weak)
    trials: dict[str, list[Option]] = {"proposed": advice.proposed}
    for row in sorted(advice.weak, key=lambda row: row.reach.sigma / row.limit)[:TRIED]:
        for kind, prospect in (("motion", row.motion), ("sensor", row.sensor)):
            if prospect is not None and list(prospect.options) not in trials.values():
                trials[f"{kind} for {row.name}"] = list(prospect.options)
    now = prospects.sigmas([])
    of_motions = [option for option in prospects.options if option.motion is not None]
    gains = [sum(now[name] / prospects.sigmas([each])[name] for name in study.weak) for each in of_motions]
    trials["helps least"] = [of_motions[int(np.argmin(gains))]]
    lines = []
    for label, options in trials.items():
        predicted = prospects.sigmas(options)
        after = study_recording(robot.believed, robot.plant, robot.added(recording, options))
        lines += _lines(label, study, after, predicted)
        print(f"robot {robot.seed}, {label}: done", flush=True)
    return lines


def _lines(
    label: str, before: IdentifyStudy, after: IdentifyStudy, predicted: dict[str, float]
) -> list[dict]:
    was = {each.name: each for each in before.parameters}
    return [
        {
            "trial": label,
            "name": each.name,
            "was": was[each.name].sigma / was[each.name].value,
            "predicted": predicted[each.name],
            "is": each.sigma / each.value,
            "error": each.value / each.true - 1.0,
            "identifiable": each.identifiable,
        }
        for each in after.parameters
        if each.name in before.weak and each.true
    ]


def report(lines: list[dict]) -> None:
    """Prints how predictions came out."""
    for kind in ("proposed", "motion for", "sensor for", "helps least"):
        rows = [row for row in lines if row["trial"].startswith(kind)]
        if not rows:
            continue
        ratio = np.array([row["is"] / row["predicted"] for row in rows])
        gain = np.median([row["is"] / row["was"] for row in rows])
        inside = np.mean([abs(row["error"]) < WITHIN * row["is"] for row in rows])
        print(
            f"{kind}: {len(rows)} weak parameters, sigma over that predicted {np.median(ratio):.2f} "
            f"(median), {ratio.min():.2f} to {ratio.max():.2f}, "
            f"{np.mean((ratio > 0.5) & (ratio < 2.0)):.2f} within a factor of two; "
            f"over that before {gain:.2f} (median); "
            f"{inside:.2f} of 95 % intervals hold the truth"
        )
    limits = {"stiffness": STIFFNESS_KNOWN, "damping": DAMPING_KNOWN}
    sure = [row for row in lines if row["predicted"] < limits[row["name"].split("_")[0]]]
    print(f"{sum(row['identifiable'] for row in sure)} of {len(sure)} that should become known are known")


def main(robots: int, path: Path, first: int) -> None:
    """Does what is not there, then reports."""
    kept = [json.loads(text) for text in path.read_text().splitlines()] if path.exists() else []
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in range(first, first + robots):
        if seed in [each["robot"] for each in kept]:
            continue
        kept.append({"robot": seed, "lines": tried(Robot(seed))})
        with path.open("a") as file:
            file.write(json.dumps(kept[-1]) + "\n")
    report([row for each in kept for row in each["lines"]])


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    main(int(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 0)
