"""Where the frame of an instrument stands in the world of the robot, before anything else is known.

A tracker or a camera measures in a frame of its own. A calibration that had to find it together with the
errors would start metres away and end anywhere; the rigid motion that brings the nominal robot nearest to
what was measured is found in closed form.
"""

from dataclasses import replace

import numpy as np

from robots.calibration.error_model import ErrorModel
from robots.calibration.measurements import Measurements
from robots.description.model import RobotModel
from robots.metrology.least_squares import UndeterminedError
from robots.metrology.point_registration import register_points
from robots.pose import zyx_from_rotation

_ROUNDS = 15
_NEAREST = 0.1  # of the median distance: no point weighs more than one at that distance
_APART = 5.0  # medians of the distances from the middle, beyond which a point is likely a slip
_POINTS = 3  # that a registration takes
_ELSEWHERE = (0.1, float(np.deg2rad(10.0)))  # m, rad: farther is no error of the base but another frame


def instrument_frame(
    predicted: np.ndarray, measured: np.ndarray, far: float, turned: float
) -> np.ndarray | None:
    """The motion that brings predicted positions to measured ones with the least sum of distances.

    Least squares with weights of one over the distance, again and again, so that gross errors do not count;
    what is far from all other points is left out before.

    Args:
        predicted: of the tool by the nominal robot in m, shape (n, 3).
        measured: by the instrument in m, shape (n, 3).
        far, turned: m and rad; a smaller motion is an error of the robot and not another frame.

    Returns:
        Homogeneous matrix (4, 4), from the world of the robot to the frame of the instrument; None where it
        measures in the world of the robot.

    Raises:
        UndeterminedError: if the points are too few, on one line, mirrored, or of different size.
    """
    together = _together(measured)
    predicted, measured = predicted[together], measured[together]
    weights, X = np.ones(len(predicted)), None
    for _ in range(_ROUNDS):
        found = register_points(predicted, measured, weights)
        X = found.X_DK.GetAsMatrix4()
        if not _is_elsewhere(X, far, turned):
            return None
        distances = np.linalg.norm(found.residual, axis=1)
        if distances.max() < 1e-12:
            break
        weights = 1.0 / np.maximum(distances, _NEAREST * np.median(distances) + 1e-12)
        weights /= weights.max()
    return X


def _together(measured: np.ndarray) -> np.ndarray:
    """Which points (n,) are not far from all others, as a coordinate that lost its decimal point is.

    Kilometres would decide how far apart the points are, whatever they weigh.
    """
    if not len(measured):
        return np.zeros(0, dtype=bool)
    away = np.linalg.norm(measured - np.median(measured, axis=0), axis=1)
    return np.asarray(away <= _APART * np.median(away))


def _is_elsewhere(X: np.ndarray, far: float, turned: float) -> bool:
    """Whether a motion (4, 4) is more than an error of the base: farther than m or turned more than rad."""
    cosine = 0.5 * (np.trace(X[:3, :3]) - 1.0)
    return bool(np.linalg.norm(X[:3, 3]) > far or cosine < np.cos(turned))


def in_frame_of_instrument(
    robot: RobotModel, measurements: Measurements
) -> tuple[RobotModel, np.ndarray | None]:
    """The robot with its base where the instrument sees it; the frame (4, 4), None if it is the world."""
    model = ErrorModel(robot)
    predicted = model.forward(measurements.q, np.zeros(len(model)))[:, :3, 3]
    try:
        X = instrument_frame(predicted, measurements.position, *_ELSEWHERE)
    except UndeterminedError:  # too few points for a frame; what they are good for is said later
        return robot, None
    if X is None:
        return robot, None
    X_IB = X @ robot.base.pose().GetAsMatrix4()
    base = replace(
        robot.base,
        translation=X_IB[:3, 3],
        zyx_deg=np.rad2deg(zyx_from_rotation(X_IB[:3, :3])),
        source=f"in the frame of the instrument; {robot.base.source}",
    )
    return replace(robot, base=base), X
