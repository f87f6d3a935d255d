"""What has been learnt of a robot as a robot file, and what such a file lets one know beforehand."""

from dataclasses import replace

import numpy as np

from robots.calibration.error_model import ErrorModel
from robots.description.calibration import Calibration
from robots.description.drive_train import DriveTrain
from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.error_kinematics import ErrorKinematics

_CONFIGURATIONS = 60
_LEAST_FACTOR = 0.05  # of a compliance: no spring is taken to be stiffer than 20 times its belief

GEAR_NAMES = tuple(f"gear_{i}" for i in range(1, NUM_JOINTS + 1))
BEARING_NAMES = tuple(f"bearing_{side}_{i}" for i in range(1, NUM_JOINTS + 1) for side in "ab")


def learnt_robot(
    robot: RobotModel,
    p: np.ndarray,
    factors: np.ndarray,
    known: tuple[list[str], np.ndarray, np.ndarray],
    of: str,
) -> RobotModel:
    """A robot with the geometry and the springs that were learnt.

    Args:
        robot: as it was believed.
        p: its geometric errors, (48,), as `robots.description.error_parameters` orders them.
        factors: of the compliances of six gears and twelve bearings, (18,); zero for what does not yield.
        known: names, values and covariance of what was estimated of the robot.
        of: the robot that stands in the scenario.
    """
    names, values, covariance = known
    corrected = ErrorKinematics(robot).robot_with_errors(p)
    joints = []
    for i, joint in enumerate(corrected.joints):
        gear, bearing = factors[i], factors[6 + 2 * i : 8 + 2 * i]
        if gear > 0.0:
            joint = replace(joint, drive_train=_softer(joint.drive_train, float(gear)))
        if joint.tilting and bearing.any():
            share = 1.0 / np.maximum(bearing, _LEAST_FACTOR)
            springs, dampers = np.asarray(joint.tilting.stiffness), np.asarray(joint.tilting.damping)
            tilting = replace(
                joint.tilting,
                stiffness=(share * springs).tolist(),
                damping=(share * dampers).tolist(),
                source="learnt at work",
            )
            joint = replace(joint, tilting=tilting)
        joints.append(joint)
    rows = [row[: i + 1].tolist() for i, row in enumerate(covariance)]
    calibration = Calibration(
        of, source="learnt at work", names=names, values=values.tolist(), covariance=rows
    )
    name = robot.name if robot.is_calibrated else f"{robot.name}, calibrated"
    return replace(corrected, joints=joints, name=name, calibration=calibration)


def _softer(train: DriveTrain, factor: float) -> DriveTrain:
    share = 1.0 / max(factor, _LEAST_FACTOR)
    return replace(train, stiffness=share * train.stiffness, damping=share * train.damping)


def known_before(
    robot: RobotModel, drawn: RobotModel, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """What the file of a calibrated robot says of how well it is known; None if it does not say.

    A file of `truetip calibrate` has the parameters of `robots.calibration.error_model`. They move the tool
    as the chosen ones of `robots.description.error_parameters` do, of which they are made by least squares.

    Args:
        robot: calibrated.
        drawn: the robot that was calibrated.
        chosen: indices of the g independent error parameters.

    Returns:
        Covariance of the chosen parameters (m, rad) and of 18 factors of compliances, (g + 18, g + 18); and
        which of these have an entry in the file, bool (g + 18,).
    """
    names, covariance = robot.calibration.names, robot.calibration.covariance_matrix
    if not names:
        return None
    values = dict(zip(names, robot.calibration.values, strict=True))
    own = [parameter.name for parameter in ErrorKinematics(drawn).parameters]
    wanted = [own[i] for i in chosen] + [*GEAR_NAMES, *BEARING_NAMES]
    T = np.zeros((len(wanted), len(names)))
    for column, name in enumerate(names):
        if name in wanted:
            # The springs of the file are the learnt ones: their factors count from one again.
            is_factor = name in GEAR_NAMES or name in BEARING_NAMES
            T[wanted.index(name), column] = 1.0 / max(values[name], _LEAST_FACTOR) if is_factor else 1.0
    model = ErrorModel(drawn)
    complete = [names.index(name) for name in model.names if name in names]
    if complete:
        q = np.random.default_rng(0).uniform(drawn.lower, drawn.upper, (_CONFIGURATIONS, NUM_JOINTS))
        theirs = model.forward_and_regressor(q, np.zeros(len(model)))[1].reshape(-1, len(model))
        ours = ErrorKinematics(drawn).regressor(q, np.zeros(len(own)))[..., chosen].reshape(len(theirs), -1)
        columns = theirs[:, [model.names.index(names[i]) for i in complete]]
        T[: len(chosen), complete] = np.linalg.lstsq(ours, columns, rcond=None)[0]
    return T @ covariance @ T.T, np.abs(T).max(axis=1) > 0.0
