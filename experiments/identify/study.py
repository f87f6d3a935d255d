"""A robot identified from recorded motions, and how well its inverse model then follows a rectangle."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.cli.workers import Executor, Progress, SimulationError, in_order
from experiments.feedforward.rectangle import RectangleTrial
from experiments.identify.advice.advise import Advice, advise
from experiments.identify.advice.report import advice_json
from experiments.identify.closed_loop.drives import RefinedDrives, refined_drives
from experiments.identify.closed_loop.fit import GAINS
from experiments.identify.fine_tuning.report import fine_tuning_json
from experiments.identify.fine_tuning.tuning import SHARE, FineTuning, fine_tune
from experiments.identify.judge.judge import Verdict, judge
from experiments.identify.judge.report import judge_json
from experiments.identify.recording_map import Recording
from experiments.identify.slow import slow_json, with_slow_motion
from robots.description.model import NUM_JOINTS, RobotModel
from robots.identification.arm_identification import ArmIdentification, identify_arm
from robots.identification.identified_robot import FoundParameter, found_parameters, identified_robot
from robots.identification.motion import SensorPlace
from robots.identification.recording import RecordedCase, RecordingError
from robots.identification.slow_motion import SlowIdentification
from systems.cell.drive import DriveConfig
from systems.feedforward import FeedforwardConfig

_STIFFNESS, _DAMPING = "stiffness_", "damping_"
_SLOW_FRICTION = 0.03  # relative standard deviation of friction that slow motions have shown


@dataclass(frozen=True)
class IdentifyStudy:
    """What was found of a robot, and what it is good for."""

    robot: RobotModel  # as it was believed to be
    plant: RobotModel | None  # what moved in a simulation
    payload: float  # kg
    found: ArmIdentification
    parameters: list[FoundParameter]
    identified: RobotModel
    seconds: float  # from the recording to the parameters
    slow: SlowIdentification | None  # of slow motions, where there were some
    rectangle_ratio: dict[str, float] | None  # deviation with `elastic_structure` over that with `rigid`
    drives: RefinedDrives | None = None  # of closed loop
    fine_tuning: FineTuning | None = None  # of the inverse model, on the robot
    advice: Advice | None = None  # what to record further
    verdict: Verdict | None = None  # of the full simulation

    @property
    def final(self) -> RobotModel:
        """The identified robot, with what fine tuning has changed where that is taken over."""
        return self.identified if self.fine_tuning is None else self.fine_tuning.robot

    def errors(self, kind: str) -> np.ndarray:
        """Relative errors of identifiable parameters of a kind, ``"stiffness_"`` or ``"damping_"``."""
        return np.array(
            [
                each.value / each.true - 1.0
                for each in self.parameters
                if each.true and each.identifiable and each.name.startswith(kind)
            ]
        )

    @property
    def weak(self) -> list[str]:
        """Springs and dampers that the recording does not show well enough."""
        kinds = (_STIFFNESS, _DAMPING)
        return [
            each.name for each in self.parameters if each.name.startswith(kinds) and not each.identifiable
        ]


def study_identification(
    robot: RobotModel,
    plant: RobotModel | None,
    payload: float,
    recorded: Sequence[RecordedCase],
    sensors: list[SensorPlace],
    gear_parts: bool = True,
    progress: Callable[[float], None] | None = None,
    slow: SlowIdentification | None = None,
) -> IdentifyStudy:
    """Identifies a robot; without the rectangle.

    Args:
        robot: as it is believed to be.
        plant: what moved, if that is known.
        payload: mass at the flange in kg.
        recorded: the motions.
        sensors: in the order of their readings.
        gear_parts: whether gears may have play, hysteresis and ripple.
        progress: is called now and then with the share that is done, 0 to 1.
        slow: what slow motions have said before, for the study to keep.

    Raises:
        RecordingError: if the recording cannot be used.
        ValueError: if a sensor sits where the robot has no body.
    """
    started = time.perf_counter()
    found = identify_arm(robot, payload, recorded, sensors, gear_parts, progress)
    parameters = found_parameters(robot, found.fit, plant)
    identified = identified_robot(robot, found.fit)
    seconds = time.perf_counter() - started
    return IdentifyStudy(robot, plant, payload, found, parameters, identified, seconds, slow, None)


def study_recording(
    robot: RobotModel,
    plant: RobotModel | None,
    recording: Recording,
    gear_parts: bool = True,
    slow: SlowIdentification | None = None,
    progress: Callable[[float], None] | None = None,
) -> IdentifyStudy:
    """Identifies a robot from a whole recording; its payload is the largest where the recording has none.

    Args:
        robot: as it is believed to be.
        plant: what moved, if that is known.
        recording: motions, sensors and payload.
        gear_parts: whether gears may have play, hysteresis and ripple.
        slow: what slow motions say of load, counterbalance and friction, believed from here on.
        progress: as of `study_identification`, and so are the errors.
    """
    if not recording.cases or not recording.sensors:
        raise RecordingError("a recording needs motions and sensors: springs do not show in the motors alone")
    payload = robot.payload.largest_mass if recording.payload is None else recording.payload
    if slow is not None:
        robot, payload = with_slow_motion(robot, slow), slow.payload
    cases, sensors = recording.cases, recording.sensors
    return study_identification(robot, plant, payload, cases, sensors, gear_parts, progress, slow)


def with_drives(
    study: IdentifyStudy,
    recording: Recording,
    believed: DriveConfig,
    true: DriveConfig | None,
    progress: Callable[[float], None] | None = None,
) -> IdentifyStudy:
    """The study with drives, friction and dampers refined in closed loop; see `refined_drives`."""
    fit = study.found.fit
    drives = refined_drives(study.robot, study.plant, study.payload, fit, recording, believed, true, progress)
    return replace(study, drives=drives, parameters=drives.parameters, identified=drives.identified)


def with_fine_tuning(
    study: IdentifyStudy,
    executor: Executor,
    share: float = SHARE,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> IdentifyStudy:
    """The study with its inverse model tuned on the robot; arguments and errors as of `fine_tune`."""
    if study.plant is None:
        raise ValueError(
            "fine tuning needs a robot to drive, and nobody knows what was recorded: give its plant"
        )
    found = study.parameters
    if study.slow is not None:
        of_joints = range(1, NUM_JOINTS + 1)
        found = [row for row in found if "_friction_" not in row.name]
        found += [FoundParameter(f"slow_friction_{i}", "", 1.0, _SLOW_FRICTION, True) for i in of_joints]
    tuning = fine_tune(
        study.identified,
        study.plant,
        study.payload,
        executor,
        found,
        share,
        seed=seed,
        progress=progress,
    )
    return replace(study, fine_tuning=tuning)


def with_advice(
    study: IdentifyStudy, executor: Executor, progress: Callable[[float], None] | None = None
) -> IdentifyStudy:
    """The study with what to record further for what it has not found; see `advise`."""
    advice = advise(study.robot, study.payload, study.found, study.weak, executor, progress)
    return replace(study, advice=advice)


def with_verdict(
    study: IdentifyStudy,
    recording: Recording,
    executor: Executor,
    progress: Callable[[float], None] | None = None,
) -> IdentifyStudy:
    """The study with what the full simulation says of it; see `judge`."""
    commands = None
    if study.drives is not None and all(case.commands is not None for case in recording.cases):
        commands = recording, DriveConfig(), study.drives.drive
    verdict = judge(study.robot, study.identified, study.found, executor, progress, commands)
    return replace(study, verdict=verdict)


def with_rectangle(
    study: IdentifyStudy, executor: Executor, progress: Callable[[float], None]
) -> IdentifyStudy:
    """The study with the rectangle of `truetip feedforward` driven on what moved.

    Raises:
        SimulationError: if a run broke off.
    """
    rigid, elastic = (FeedforwardConfig(kind, rough_path="accept") for kind in ("rigid", "elastic_structure"))
    driven = {"rigid": (study.robot, rigid), "nominal": (study.robot, elastic)}
    driven["identified"] = study.identified, elastic
    if study.fine_tuning is not None and study.fine_tuning.is_taken_over:
        driven["fine_tuned"] = study.final, elastic
    trials = [RectangleTrial(robot, study.payload, config, study.plant) for robot, config in driven.values()]
    of_rigid, *others = in_order(executor, _integral, trials, progress)
    return replace(
        study,
        rectangle_ratio={name: each / of_rigid for name, each in zip(list(driven)[1:], others, strict=True)},
    )


def _integral(trial: RectangleTrial, progress: Progress) -> float:
    try:
        return trial.run(progress).integral
    except RuntimeError as error:
        raise SimulationError(f"{trial.config.kind}: {' '.join(str(error).split())}") from error


def identify_json(study: IdentifyStudy) -> dict[str, Any]:
    """The numbers in SI units; ``true`` and errors only where the truth is known."""
    fit = study.found.fit
    numbers: dict[str, Any] = {
        "robot": study.robot.name,
        "payload_kg": study.payload,
        "cases": len(study.found.cases),
        "parameters": {
            each.name: {
                "value": each.value,
                "sigma": each.sigma,
                "unit": each.unit,
                "identifiable": each.identifiable,
            }
            | ({} if each.true is None else {"true": each.true})
            for each in study.parameters
        },
        "weak": study.weak,
        "condition": fit.condition,
        "seconds": study.seconds,
        "evaluations": fit.evaluations,
    }
    if study.plant is not None:
        for label, kind in (("stiffness", _STIFFNESS), ("damping", _DAMPING)):
            errors = np.abs(study.errors(kind))
            numbers[f"worst_{label}_error"] = float(errors.max()) if len(errors) else None
            numbers[f"median_{label}_error"] = float(np.median(errors)) if len(errors) else None
    if study.drives is not None:
        drive = study.drives.drive
        gains = {f"{name}_1_s": getattr(drive.cascade, name) for name in GAINS}
        numbers["drive"] = gains | {"command_delay_s": drive.command_delay}
    if study.advice is not None:
        numbers["advice"] = advice_json(study.advice)
    if study.verdict is not None:
        numbers["judge"] = judge_json(study.verdict)
    if study.fine_tuning is not None:
        numbers["fine_tuning"] = fine_tuning_json(study.fine_tuning)
    if study.slow is not None:
        numbers["slow_motion"] = slow_json(study.slow)
    if study.rectangle_ratio is not None:
        numbers["rectangle_ratio"] = study.rectangle_ratio
    return numbers
