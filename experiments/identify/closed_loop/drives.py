"""Drives and dampers of a robot that is identified already, from the same motions in closed loop."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from experiments.identify.closed_loop.fit import (
    FRICTION,
    GAINS,
    DriveFit,
    DriveUnknowns,
    RecordedDrive,
    refine_drives,
)
from experiments.identify.recording_map import Recording
from robots.description import drive_parts
from robots.description.drive_train import DriveTrain
from robots.description.model import NUM_JOINTS, RobotModel
from robots.identification.arm_fit import ArmFit
from robots.identification.identified_robot import FoundParameter, found_parameters, identified_robot
from robots.identification.recording import RecordingError
from systems.cell.drive import DriveConfig

_CASES = 4  # motions that are used: each goes forward some hundred times
_WHOLE = 1e-3  # of a sample
# Standard deviations below which a number counts as known: shares of gains and friction, s of delay and lag.
_GAIN_KNOWN, _FRICTION_KNOWN, _TIME_KNOWN = 0.05, 0.1, 2e-4
# Share of Coulomb's friction that a hump may add where a robot does not say of which kind its friction is:
# short motions do not show the shape (`--slow` does), and both numbers are wrong by as much.
_SHAPE = 0.3
_UNITS = {"viscous": "Nms/rad", "coulomb": "Nm"}


@dataclass(frozen=True)
class RefinedDrives:
    """What closed loop says."""

    drive: DriveConfig  # gains and delay
    parameters: list[FoundParameter]  # of drives and friction, then those of the arm
    identified: RobotModel
    fit: DriveFit


def refined_drives(
    robot: RobotModel,
    plant: RobotModel | None,
    payload: float,
    fit: ArmFit,
    recording: Recording,
    believed: DriveConfig,
    true: DriveConfig | None = None,
    progress: Callable[[float], None] | None = None,
) -> RefinedDrives:
    """Refines drives, friction and dampers.

    Args:
        robot: as it is believed to be.
        plant: what moved, if that is known.
        payload: mass at the flange in kg.
        fit: of the arm.
        recording: with commands and torques.
        believed: gains and delays.
        true: those of what moved, if they are known.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        RecordingError: if the recording lacks commands or torques.
        ValueError: if the friction of the robot is of a kind that is not refined.
    """
    recorded = driven_motions(recording)
    found, unknowns = refine_drives(
        robot, payload, fit, recorded, believed, recording.command_period, progress
    )
    arm = unknowns.refined(found.values, found.covariance)
    rows = _drive_rows(robot, plant, found, unknowns, true)
    known = {row.name for row in rows if row.identifiable}
    identified = _with_drives(identified_robot(robot, arm), robot, found, unknowns, known)
    return RefinedDrives(
        unknowns.drive(found.values), rows + found_parameters(robot, arm, plant), identified, found
    )


def driven_motions(recording: Recording) -> list[RecordedDrive]:
    """Some of the motions with the payload of the recording, evenly chosen.

    Raises:
        RecordingError: if they have no commands or torques.
    """
    cases = [case for case in recording.cases if case.payload is None]
    if not cases:
        raise RecordingError("drives: all motions have payloads of their own, and none that of the recording")
    samples = recording.command_period / cases[0].period
    if samples < 1.0 - _WHOLE or abs(samples - round(samples)) > _WHOLE * samples:
        raise RecordingError(
            f"drives: the recording has a sample every {1e3 * cases[0].period:g} ms, and a command every "
            f"{1e3 * recording.command_period:g} ms (command_period): this must be a whole number of samples"
        )
    chosen = []
    for case in cases[:: max(1, -(-len(cases) // _CASES))]:
        if case.commands is None or not len(case.torque):
            raise RecordingError(
                f"drives: case {case.name} has no {'torques' if case.commands is not None else 'commands'}: "
                "what the drives were told and what they gave is needed to refine them"
            )
        chosen.append(RecordedDrive(case.at_lag(0.0), case.torque, case.commands))
    return chosen


def _drive_rows(
    robot: RobotModel,
    plant: RobotModel | None,
    fit: DriveFit,
    unknowns: DriveUnknowns,
    true: DriveConfig | None,
) -> list[FoundParameter]:
    sigma = dict(zip(fit.names, fit.sigma.tolist(), strict=True))
    found = unknowns.drive(fit.values)
    rows = []
    for name in GAINS:
        value, of_true = getattr(found.cascade, name), true and getattr(true.cascade, name)
        is_known = sigma[name] < _GAIN_KNOWN
        rows.append(
            FoundParameter(f"drive_{name}_gain", "1/s", value, value * sigma[name], is_known, of_true)
        )
    lags = None if plant is None else np.mean([joint.drive_train.motor_lag for joint in plant.joints])
    delay = true and true.command_delay + true.dead_time
    for name, key, value, of_true in (
        ("drive_delay", "delay", found.command_delay, delay),
        ("motor_lag", "lag", unknowns.lag(fit.values), None if lags is None else float(lags)),
    ):
        s = 1e-3 * sigma[key]
        rows.append(FoundParameter(name, "s", value, s, s < _TIME_KNOWN, of_true))
    of_plant = None if plant is None else DriveUnknowns.believed_frictions(plant)
    for kind in FRICTION:
        for i, part in enumerate(unknowns.frictions(fit.values)):
            shape = _SHAPE if robot.joints[i].drive_train.friction is None else 0.0
            value, s = getattr(part, kind), float(np.hypot(sigma[f"{kind}_{i + 1}"], shape))
            of_true = None if of_plant is None else getattr(of_plant[i], kind)
            name = f"{kind}_friction_{i + 1}"
            rows.append(FoundParameter(name, _UNITS[kind], value, value * s, s < _FRICTION_KNOWN, of_true))
    return rows


def _with_drives(
    identified: RobotModel, robot: RobotModel, fit: DriveFit, unknowns: DriveUnknowns, known: set[str]
) -> RobotModel:
    factors = np.exp(unknowns.friction_factors(fit.values))
    joints = []
    for i in range(NUM_JOINTS):
        train = identified.joints[i].drive_train
        viscous, coulomb = (
            float(factors[k, i]) if f"{kind}_friction_{i + 1}" in known else 1.0
            for k, kind in enumerate(FRICTION)
        )
        train = _rubbing(train, viscous, coulomb)
        if "motor_lag" in known:
            train = replace(train, motor_lag=unknowns.lag(fit.values))
        joints.append(replace(identified.joints[i], drive_train=train))
    return replace(identified, joints=joints)


def _rubbing(train: DriveTrain, viscous: float, coulomb: float) -> DriveTrain:
    """With so many times the friction."""
    part = train.friction
    if part is None:
        return replace(
            train,
            viscous_friction=viscous * train.viscous_friction,
            coulomb_friction=coulomb * train.coulomb_friction,
        )
    assert isinstance(part, drive_parts.Sigmoid | drive_parts.Tanh | drive_parts.Stribeck)
    changes = {"viscous": viscous * part.viscous, "coulomb": coulomb * part.coulomb}
    if isinstance(part, drive_parts.Stribeck):
        changes["hump"] = coulomb * part.hump
    return replace(train, friction=replace(part, **changes))
