"""Slow motions of a recording: payload, counterbalance and friction, and the robot with these."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from experiments.identify.recording_file import read_recording
from experiments.identify.recording_map import Recording
from robots.description.model import RobotModel
from robots.identification.recording import RecordingError, check_range
from robots.identification.slow_motion import SlowIdentification, SlowMotion, identify_slow_motion

_SOURCE = "identified from slow motion"


def identify_slow_recording(
    path: Path, robot: RobotModel, payload: float | None = None
) -> SlowIdentification:
    """Reads a recording with torques and finds payload, counterbalance and friction.

    Args:
        path: of the recording.
        robot: as it is believed to be.
        payload: kg, of the short motions for which the load that is found will be taken; None if not known.

    Raises:
        RecordingError: if the recording has no torques, or says that it has another payload.
        ValueError: if it cannot be read or does not show what is wanted.
    """
    recording = read_recording(path, needs_sensors=False)
    if any(not len(case.torque) for case in recording.cases):
        raise RecordingError(f"{path}: slow motions need the torques of the motors: six columns as torque")
    return identify_slow_motions(recording, robot, payload)


def identify_slow_motions(
    recording: Recording, robot: RobotModel, payload: float | None = None
) -> SlowIdentification:
    """Finds payload, counterbalance and friction in slow motions with torques; arguments as above.

    Raises:
        RecordingError: if a motion has no torques, another payload than others, or positions no joint has.
        ValueError: if the motions do not show what is wanted.
    """
    if any(not len(case.torque) for case in recording.cases):
        raise RecordingError("slow motions need the torques of the motors")
    if payload is not None and recording.payload not in (None, payload):
        raise RecordingError(
            f"slow motions have {recording.payload:g} kg at the flange and the others {payload:g} kg; what "
            "is found of their load is taken for all: record both with one"
        )
    others = {case.name: case.payload for case in recording.cases if case.payload is not None}
    if set(others.values()) - {recording.payload}:
        said = ", ".join(f"{load:g} kg in {name}" for name, load in others.items())
        raise RecordingError(f"slow motions must have one payload, got {said}")
    check_range(recording.cases, robot.lower, robot.upper)
    payload = robot.payload.largest_mass if recording.payload is None else recording.payload
    parts = [
        (c.theta, c.rate, CubicSpline(c.time, c.rate).derivative()(c.time), c.torque) for c in recording.cases
    ]
    theta, rate, acceleration, torque = (np.concatenate(each) for each in zip(*parts, strict=True))
    motion = SlowMotion(recording.cases[0].period, theta, rate, acceleration, torque)
    return identify_slow_motion(robot, payload, motion)


def with_slow_motion(robot: RobotModel, slow: SlowIdentification) -> RobotModel:
    """The robot with the friction, the counterbalance and the centre of the load that were found."""
    joints = []
    for joint, kinds in zip(robot.joints, slow.frictions, strict=True):
        train = joint.drive_train
        if kinds:
            train = replace(train, viscous_friction=0.0, coulomb_friction=0.0, friction=kinds[0].friction)
        joints.append(replace(joint, drive_train=train))
    spring = robot.counterbalance
    if spring is not None and slow.spring_stiffness is not None and slow.spring_preload is not None:
        spring = replace(spring, stiffness=slow.spring_stiffness, preload=slow.spring_preload, source=_SOURCE)
    load = replace(robot.payload, center_of_mass=slow.payload_centre, center_of_mass_source=_SOURCE)
    return replace(robot, joints=joints, counterbalance=spring, payload=load)


def slow_json(slow: SlowIdentification) -> dict[str, Any]:
    """The numbers in SI units; kinds of friction with their criterion, the best first."""
    numbers: dict[str, Any] = {
        "payload_kg": slow.payload,
        "payload_centre_m": slow.payload_centre.tolist(),
        "sigma_payload_kg": float(slow.sigma[0]),
        "samples": int(slow.moving.any(axis=1).sum()),
        "friction": [
            [{"kind": each.kind, "criterion": each.criterion, "spread_Nm": each.spread} for each in kinds]
            for kinds in slow.frictions
        ],
    }
    if slow.spring_stiffness is not None:
        numbers["counterbalance"] = {
            "stiffness": slow.spring_stiffness,
            "preload": slow.spring_preload,
            "sigma_stiffness": float(slow.sigma[4]),
            "sigma_preload": float(slow.sigma[5]),
        }
    return numbers
