"""Where the links of a robot stand whose joints yield to gravity, and how poses change with that."""

from dataclasses import dataclass

import numpy as np

from robots.calibration.error_model import ZEROS, Chain, ErrorModel
from robots.calibration.loads import CENTRE_NAMES, MASS_NAMES, NUM_MASSES, Loads
from robots.calibration.prior import CENTRE_OF_MASS, MASS, compliance_sizes, mass_sizes
from robots.description.model import NUM_JOINTS, RobotModel

COMPLIANCE_NAMES = tuple(f"c_{number}" for number in range(1, NUM_JOINTS + 1))
YIELDING_NAMES = (*COMPLIANCE_NAMES, *MASS_NAMES, *CENTRE_NAMES)
_SAG_ROUNDS = 3  # a joint yields by a thousandth of a radian, its torque changes by a thousandth of that


def yielding_sizes(
    robot: RobotModel, mass: float = MASS, centre_of_mass: float = CENTRE_OF_MASS
) -> np.ndarray:
    """Standard deviations before the measurement in the order of `YIELDING_NAMES`, SI units, (34,)."""
    return np.concatenate([compliance_sizes(robot), mass_sizes(mass, centre_of_mass)])


@dataclass(frozen=True)
class Sag:
    """Links that have yielded."""

    q: np.ndarray  # (n, 6) rad, where they stand but for the errors of the robot
    torque: np.ndarray  # (n, 6) N m, of gravity and a counterbalance
    by_masses: np.ndarray  # (n, 6, 28), its derivative


class YieldingJoints:
    """A robot whose joints yield in proportion to the torque of its weight and its loads.

    The parameters y are six compliances in rad / (N m), then 28 errors of masses as `Loads` has them.
    """

    def __init__(self, model: ErrorModel, loads: Loads) -> None:
        """Takes the kinematics and what bends the joints."""
        self._model, self._loads = model, loads

    def sag(self, theta: np.ndarray, x: np.ndarray, y: np.ndarray) -> Sag:
        """Where links stand with motors at theta (n, 6), for errors x of the model and y, (34,)."""
        compliance, masses = np.split(y, [NUM_JOINTS])
        q, torque, by_masses = theta, np.zeros_like(theta), np.zeros((*theta.shape, NUM_MASSES))
        for _ in range(_SAG_ROUNDS):
            # The counterbalance acts at the angle of the link, whose zero may be shifted.
            torque, by_masses = self._loads.torque(q, self._model.chain(q, x, theta), masses)
            q = theta + compliance * torque
        return Sag(q, torque, by_masses)

    def columns(
        self, chain: Chain, Theta: np.ndarray, y: np.ndarray, sag: Sag
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of poses by all parameters.

        Args:
            chain: where the links stand.
            Theta: regressors of the error model there, (n, 6, m).
            y: as for `sag`.
            sag: at these parameters.

        Returns:
            By the errors of the model (n, 6, m), which change the torques too, and by y, (n, 6, 34).
        """
        compliance, masses = np.split(y, [NUM_JOINTS])
        J = Theta[:, :, ZEROS]
        by_model = Theta + J @ (compliance[:, None] * self._loads.by_geometry(chain, Theta, masses))
        by_y = [J * sag.torque[:, None, :], J @ (compliance[:, None] * sag.by_masses)]
        return by_model, np.concatenate(by_y, axis=-1)
