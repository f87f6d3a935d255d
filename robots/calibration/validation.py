"""Validation of a model on poses that were not used for its identification."""

from dataclasses import asdict, dataclass

import numpy as np
from scipy.special import chdtri

from robots.calibration.error_model import ZEROS
from robots.calibration.identified import Identified
from robots.calibration.measurements import Measurements
from robots.calibration.prior import not_to_be_believed
from robots.calibration.solver.noise_model import NoiseModel, row_sigmas
from robots.description.model import RobotModel
from robots.dynamics.compliant_kinematics import controller_kinematics
from robots.pose import pose_error

_RISK = 1e-3  # that a clean table loses a row
_BENEFIT_OF_DOUBT = 2.0  # times as far as the spread of the other rows explains: a model is never perfect
_ROUNDING = 1e-6  # m or rad, below which nothing is a gross error


@dataclass(frozen=True)
class ErrorStatistics:
    """Absolute errors per axis over a set of poses, as in Probst (2024), table 6.3.

    Along and about the axes of the world, the rotation as a vector; lists of three.
    """

    mean_mm: list[float]
    max_mm: list[float]
    p90_mm: list[float]
    mean_deg: list[float]
    max_deg: list[float]
    p90_deg: list[float]

    @property
    def mean_norm_mm(self) -> float:
        """Norm in mm of the vector of mean absolute errors along x, y and z."""
        return float(np.linalg.norm(self.mean_mm))

    def as_dict(self) -> dict[str, list[float]]:
        """The numbers by name; positions only where no rotation was measured."""
        return {name: numbers for name, numbers in asdict(self).items() if numbers}


def prediction_errors(robot: RobotModel, measurements: Measurements) -> np.ndarray:
    """Measured less predicted poses: rotation vector in rad, position in m, (n, 6), or (n, 3) in m."""
    X = np.empty((len(measurements), 4, 4))
    for payload in np.unique(measurements.payload):
        rows = measurements.payload == payload
        X[rows] = controller_kinematics(robot, float(payload)).forward(measurements.q[rows])
    if measurements.rotation is None:
        return measurements.position - X[:, :3, 3]
    return pose_error(measurements.X_WE, X)


def statistics(errors: np.ndarray) -> ErrorStatistics:
    """Of errors (n, 6) or (n, 3) as `prediction_errors` gives them."""
    millimetres, degrees = 1e3 * np.abs(errors[:, -3:]), np.rad2deg(np.abs(errors[:, :-3]))
    numbers = [
        summary.tolist()
        for unit in (millimetres, degrees)
        for summary in (unit.mean(axis=0), unit.max(axis=0), np.percentile(unit, 90.0, axis=0))
    ]
    return ErrorStatistics(*numbers)


def plausible_rows(identified: Identified, measurements: Measurements) -> np.ndarray:
    """The rows of a fresh table that a calibration predicts as well as it predicts the others, (n,) bool.

    What is predicted is compared with what was measured in units of the noise that the fresh table says, or
    else the calibration knows or has found, and of the median over the table, which gross errors do not move.

    Raises:
        ValueError: if most rows are farther off than any calibrated robot is.
    """
    errors = prediction_errors(identified.calibrated_robot(), measurements)
    refuse_what_cannot_be(*(np.linalg.norm(part, axis=1) for part in (errors[:, -3:], errors[:, :-3])))
    _, Theta = identified.model.forward_and_regressor(measurements.q, identified.x)
    J = Theta[:, 6 - errors.shape[1] :, ZEROS]
    noise, rows = identified.noise, row_sigmas(measurements)
    theta = np.array([noise.joint_sigma, noise.position_sigma, noise.rotation_sigma]) ** 2
    theta = np.maximum(np.where(rows.named, rows.theta, theta), [0.0, _ROUNDING**2, _ROUNDING**2])
    W = NoiseModel(theta, rows.shape).whitening(J)
    squared = np.sum(np.einsum("nij,nj->ni", W, errors) ** 2, axis=1)
    return explained_by_noise(squared, errors.shape[1])


def refuse_what_cannot_be(distances: np.ndarray, angles: np.ndarray | None = None, of: str = "") -> None:
    """Raises ValueError if half of the predictions are farther off than noise and errors of robots explain.

    Args:
        distances: of measured from predicted positions in m, any shape; NaN where there is none.
        angles: between measured and predicted orientations in rad, any shape; None where there are none.
        of: the instrument; empty where a table has one only.
    """
    why = not_to_be_believed((), np.zeros(0), distances, angles)
    if why:
        rows = f"fresh lines of {of}" if of else "fresh rows"
        raise ValueError(f"the calibrated robot does not predict {rows}: {why}")


def explained_by_noise(squared: np.ndarray, numbers: np.ndarray | int) -> np.ndarray:
    """Which predictions are as good as the others, (n,) bool.

    Args:
        squared: squares of errors in units of their noise, (n,).
        numbers: how many numbers each is the sum of, (n,) or one for all.
    """
    spread = max(float(np.median(squared / chdtri(numbers, 0.5))), 1.0)
    largest = chdtri(numbers, _RISK / max(len(squared), 1))
    return squared <= _BENEFIT_OF_DOUBT**2 * spread * largest
