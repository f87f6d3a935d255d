"""The full nonlinear simulation as the judge of an identification: what it shows beside what was measured.

The model that identifies is linear about the motion of the motors; play and hysteresis aside, it knows
nothing else. The judge is the plant of the cell, with all that the robot file says of gears and structure.
Motors move as they were measured, figure 4.2(c) of Reiner (2010), so that neither drives nor friction blur
the comparison; where drives were refined, commands drive them, too, figure 4.2(b).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.cli.workers import Executor, Progress, in_order
from experiments.identify.judge.full_run import DrivenBy, FullReadings, FullRun
from experiments.identify.recording_map import Recording
from robots.description.model import RobotModel
from robots.identification.arm_identification import ArmIdentification
from robots.identification.first_stage import moving
from robots.identification.identified_robot import identified_robot
from robots.identification.motion import KINDS, MotionCase
from systems.cell.drive import DriveConfig

# The robots that are judged: as it was believed to be, as it is written, with all values that were found.
BEFORE, WRITTEN, FOUND = "before", "written", "found"


@dataclass(frozen=True)
class JudgedSensors:
    """All sensors of a kind in one motion: root mean squares in rad/s or m/s^2."""

    case: str
    kind: str  # gyro or accelerometer
    measured: float  # about the reading at rest
    full: dict[str, float]  # what the full simulation of each robot leaves, motors as measured
    linear: dict[str, float]  # what the model of the identification leaves, of `BEFORE` and `FOUND`
    driven: dict[str, float]  # as `full`, by the commands in closed loop; empty without refined drives


@dataclass(frozen=True)
class Verdict:
    """What the judge says."""

    rows: list[JudgedSensors]  # case by case
    motors: dict[str, float]  # rad, rms of what motors in closed loop are off, of each robot; may be empty

    def left(self, kind: str, way: str, robot: str) -> float:
        """Root mean square over all motions as a share of what was measured.

        Args:
            kind: of sensors.
            way: ``full``, ``linear`` or ``driven``.
            robot: ``BEFORE``, ``WRITTEN`` or ``FOUND``.
        """
        rows = [row for row in self.rows if row.kind == kind]
        left = np.square([getattr(row, way)[robot] for row in rows]).sum()
        return float(np.sqrt(left / np.square([row.measured for row in rows]).sum()))

    @property
    def kinds(self) -> list[str]:
        """Of the sensors that there are."""
        return list(dict.fromkeys(row.kind for row in self.rows))


def judge(
    robot: RobotModel,
    written: RobotModel,
    found: ArmIdentification,
    executor: Executor,
    progress: Progress | None = None,
    commands: tuple[Recording, DriveConfig, DriveConfig] | None = None,
) -> Verdict:
    """Runs all motions with all robots.

    Args:
        robot: as it was believed to be.
        written: as it goes into the file, with former values where motions hardly show any.
        found: by the identification.
        executor: where they are simulated, each motion of each robot a job.
        progress: is called now and then with the share that is done, 0 to 1.
        commands: the recording, and drives as believed and as found, where they were refined.

    Raises:
        SimulationError: if a run broke off.
    """
    # Without doubt about any value all of them are taken over.
    sure = replace(found.fit, covariance=np.zeros_like(found.fit.covariance))
    robots = {BEFORE: robot, WRITTEN: written, FOUND: identified_robot(robot, sure)}
    as_measured: list[DrivenBy | None] = [None] * len(found.cases)
    runs = {("full", name): full_runs(each, found, as_measured) for name, each in robots.items()}
    if commands is not None:
        recording, *drives = commands
        for name, drive in zip((BEFORE, WRITTEN), drives, strict=True):
            runs["driven", name] = full_runs(robots[name], found, driven_by(recording, drive))
    shown = iter(in_order(executor, _run, [run for each in runs.values() for run in each], progress))
    seen = {key: [next(shown) for _ in each] for key, each in runs.items()}
    rows = [row for i in range(len(found.cases)) for row in _sensors(found, i, seen)]
    thetas = [case.theta for case in found.cases]
    motors = {
        name: _rms(np.concatenate([run.theta - theta for run, theta in zip(each, thetas, strict=True)]))
        for (way, name), each in seen.items()
        if way == "driven"
    }
    return Verdict(rows, motors)


def _sensors(
    found: ArmIdentification, i: int, seen: Mapping[tuple[str, str], list[FullReadings]]
) -> list[JudgedSensors]:
    """Of one case, each kind of its sensors."""
    case, measured = found.cases[i], found.measured[:, i]
    at = np.minimum(np.round(found.times / case.period).astype(int), len(case.theta) - 1)
    still = np.nanmean(case.readings[_at_rest(case)], axis=0).ravel()
    left = {
        ("linear", BEFORE): found.before[:, i] - measured,
        ("linear", FOUND): found.after[:, i] - measured,
    }
    for key, each in seen.items():
        left[key] = left_over(case, each[i])[at].reshape(len(at), -1)
        left[key][np.isnan(measured)] = np.nan
    rows = []
    for kind in KINDS:
        of_kind = np.repeat([sensor.kind == kind for sensor in found.sensors], 3)
        if of_kind.any():
            full, linear, driven = (
                {name: _rms(each[:, of_kind]) for (of, name), each in left.items() if of == way}
                for way in ("full", "linear", "driven")
            )
            size = _rms((measured - still)[:, of_kind])
            rows.append(JudgedSensors(case.name, kind, size, full, linear, driven))
    return rows


def full_runs(robot: RobotModel, found: ArmIdentification, by: Sequence[DrivenBy | None]) -> list[FullRun]:
    """The motions of a recording as a robot makes them.

    Args:
        robot: that moves.
        found: with motions, payloads and sensors.
        by: of each motion what drives it, see `FullRun`.
    """
    return [
        FullRun(robot, payload, replace(case, readings=case.readings[:, :0]), found.sensors, each)
        for case, payload, each in zip(found.cases, found.payloads, by, strict=True)
    ]


def driven_by(recording: Recording, drive: DriveConfig) -> list[DrivenBy | None]:
    """The commands of all motions; None for one without."""
    period, found = recording.command_period, []
    for case in recording.cases:
        every = max(1, round(period / case.period))
        found.append(None if case.commands is None else DrivenBy(case.commands[::every], period, drive))
    return found


def left_over(case: MotionCase, shown: FullReadings) -> np.ndarray:
    """Simulated less measured, without what is different at rest before the motion, (n, sensors, 3)."""
    left = shown.readings - case.readings
    return left - np.nanmean(left[_at_rest(case)], axis=0)


def _at_rest(case: MotionCase) -> slice:
    """Samples before the motion, some at least."""
    return slice(0, max(moving(case)[0], 10))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))


def _run(job: FullRun, progress: Progress) -> FullReadings:
    return job.run(progress)
