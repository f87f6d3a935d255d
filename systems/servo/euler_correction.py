"""The correction of the orientation in ZYX Euler angles, as the source has it."""

import math

import numpy as np

from robots.pose import (
    angular_velocity,
    euler_difference,
    euler_rates,
    rotation_from_zyx,
    zyx_angles,
    zyx_from_rotation,
)
from systems.reference.paths import CartesianPath

LARGEST_BETA = math.radians(70.0)  # beyond it the law comes to rest beside the path, by degrees at 78
_SAMPLES = 2000  # of a path, to find its largest beta


class EulerCorrection:
    """Adds to alpha, beta and gamma, Probst (2024) eqs. (5.10), (5.18), (5.19), with wrapped differences.

    Near beta = 90 degrees an error of a degree is one of any size in alpha and gamma.
    """

    def initial(self, X_WE: np.ndarray, X_WD: np.ndarray) -> np.ndarray:
        """The correction with which the command is X_WE, in rad, shape (3,)."""
        return np.array(euler_difference(zyx_angles(X_WE.tolist()), zyx_angles(X_WD.tolist())))

    def check_path(self, path: CartesianPath) -> None:
        """Refuses a path near the singular orientation. Raises ValueError."""
        X_WD = path.sample(np.linspace(0.0, path.duration, _SAMPLES))[0]
        beta = float(np.abs(zyx_from_rotation(X_WD[:, :3, :3])[:, 1]).max())
        if beta > LARGEST_BETA + 1e-9:
            raise ValueError(
                f"position_level: angles: euler needs beta within {math.degrees(LARGEST_BETA):.0f} degrees, "
                f"the path reaches {math.degrees(beta):.1f}; angles: rotation_vector takes any path"
            )

    def rate(self, X_WD: np.ndarray, X_WE: np.ndarray) -> np.ndarray:
        """The differences of the angles in rad, shape (3,)."""
        return np.array(euler_difference(zyx_angles(X_WD.tolist()), zyx_angles(X_WE.tolist())))

    def moved(self, turn: np.ndarray, step: np.ndarray) -> np.ndarray:
        """The correction after a small step (rad)."""
        return turn + step

    def command(
        self, turn: np.ndarray, rate: np.ndarray, R_WD: np.ndarray, w_WD: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Orientation and angular velocity to command, and the correction as a turn in the world in rad."""
        wanted = zyx_angles(R_WD.tolist())
        zyx = np.array(wanted) + turn
        rates = rate + euler_rates(wanted, w_WD.tolist())
        w_WC = np.array(angular_velocity(zyx.tolist(), rates.tolist()))
        return rotation_from_zyx(zyx), w_WC, np.array(angular_velocity(zyx.tolist(), turn.tolist()))
