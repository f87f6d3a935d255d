"""Where the frame of an instrument stands in the world of the robot, before anything else is known.

A tracker or a camera measures in a frame of its own. A calibration that had to find it together with the
errors would start metres away and end anywhere; the rigid motion that brings the nominal robot nearest to
what was measured is found in closed form.
"""

import numpy as np

from robots.metrology.point_registration import register_points

_ROUNDS = 15
_NEAREST = 0.1  # of the median distance: no point weighs more than one at that distance
_POINTS = 3  # that a registration takes


def instrument_frame(
    predicted: np.ndarray, measured: np.ndarray, far: float, turned: float
) -> np.ndarray | None:
    """The motion that brings predicted positions to measured ones with the least sum of distances.

    Least squares with weights of one over the distance, again and again, so that gross errors do not count.

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


def _is_elsewhere(X: np.ndarray, far: float, turned: float) -> bool:
    """Whether a motion (4, 4) is more than an error of the base: farther than m or turned more than rad."""
    cosine = 0.5 * (np.trace(X[:3, :3]) - 1.0)
    return bool(np.linalg.norm(X[:3, 3]) > far or cosine < np.cos(turned))
