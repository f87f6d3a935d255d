"""The measurements and the parameters that are to explain them, every parameter in the unit of its prior."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robots.calibration.error_model import ZEROS, ErrorModel
from robots.calibration.loads import CENTRE_NAMES, MASS_NAMES, NUM_MASSES, Loads
from robots.calibration.measurements import Measurements
from robots.description.model import NUM_JOINTS
from robots.pose import pose_error

COMPLIANCE_NAMES = tuple(f"c_{number}" for number in range(1, NUM_JOINTS + 1))
_SAG_ROUNDS = 3  # a joint yields by a thousandth of a radian, its torque changes by a thousandth of that


@dataclass(frozen=True)
class Linearised:
    """Residuals at some parameters and how they change."""

    residuals: np.ndarray  # (n, k) measured less predicted: rad, m; rotation first
    A: np.ndarray  # (n, k, m) derivative of the prediction by the scaled parameters
    J: np.ndarray  # (n, k, 6) derivative of the prediction by the joint positions


class Predicted(Protocol):
    """What the search asks of a problem."""

    def residuals(self, u: np.ndarray) -> np.ndarray:
        """Measured less predicted rows, (n, k)."""
        ...

    def linearise(self, u: np.ndarray) -> Linearised:
        """Residuals with their derivatives."""
        ...


class Problem:
    """Predicts the rows of a table from scaled parameters u; one is a standard deviation of the prior.

    The parameters are those of the error model; with ``loads`` six compliances and 28 masses follow.
    """

    def __init__(
        self,
        model: ErrorModel,
        measurements: Measurements,
        sizes: np.ndarray,
        columns: np.ndarray | None = None,
        loads: Loads | None = None,
    ) -> None:
        """Puts the parts together.

        Args:
            model: the kinematics.
            measurements: n rows.
            sizes: standard deviations of all parameters before the measurement, in SI units.
            columns: which of the parameters are free; None for all. The others stay zero.
            loads: what bends the joints; None for stiff ones.
        """
        self.model, self.measurements, self.sizes = model, measurements, sizes
        self.columns = np.arange(len(sizes)) if columns is None else columns
        self._loads = loads
        self._X_measured = measurements.X_WE
        self.rows = slice(3, 6) if measurements.rotation is None else slice(0, 6)
        self.names = (*model.names, *((*COMPLIANCE_NAMES, *MASS_NAMES, *CENTRE_NAMES) if loads else ()))

    @property
    def width(self) -> int:
        """How many numbers a row holds, k: 6 or 3."""
        return self.rows.stop - self.rows.start

    def __len__(self) -> int:
        """How many rows there are, n."""
        return len(self.measurements)

    def parameters(self, u: np.ndarray) -> np.ndarray:
        """All parameters in SI units from the free ones in units of the prior."""
        x = np.zeros(len(self.sizes))
        x[self.columns] = u * self.sizes[self.columns]
        return x

    def residuals(self, u: np.ndarray) -> np.ndarray:
        """Measured less predicted poses, (n, k)."""
        x, q = self._joints(u)[:2]
        return self._compared(self.model.forward(q, x[: len(self.model)], self.measurements.q))

    def linearise(self, u: np.ndarray) -> Linearised:
        """Residuals with their derivatives."""
        x, q, torque, by_masses = self._joints(u)
        chain, Theta = self.model.chain_and_regressor(q, x[: len(self.model)], self.measurements.q)
        whole, Theta = Theta, Theta[:, self.rows]
        J = Theta[:, :, ZEROS]
        columns = [Theta]
        if torque is not None and by_masses is not None:
            assert self._loads is not None
            compliance, masses = np.split(x[len(self.model) :], [NUM_JOINTS])
            by_geometry = self._loads.by_geometry(chain, whole, masses)
            columns = [Theta + J @ (compliance[:, None] * by_geometry)]
            columns += [J * torque[:, None, :], J @ (compliance[:, None] * by_masses)]
        A = np.concatenate(columns, axis=-1) if len(columns) > 1 else Theta
        A = A[:, :, self.columns] * self.sizes[self.columns]
        return Linearised(self._compared(chain.X_WE), A, J)

    def _joints(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]:
        """Parameters, link positions, and what bends them."""
        x, theta = self.parameters(u), self.measurements.q
        if self._loads is None:
            return x, theta, None, None
        geometry, rest = x[: len(self.model)], x[len(self.model) :]
        compliance, masses = rest[:NUM_JOINTS], rest[NUM_JOINTS : NUM_JOINTS + NUM_MASSES]
        q = theta
        for _ in range(_SAG_ROUNDS):
            # The counterbalance acts at the angle of the link, whose zero may be shifted.
            chain = self.model.chain(q, geometry, theta)
            torque, by_masses = self._loads.torque(q, chain, masses)
            q = theta + compliance * torque
        return x, q, torque, by_masses

    def _compared(self, X: np.ndarray) -> np.ndarray:
        if self.width == 3:
            return self.measurements.position - X[:, :3, 3]
        return pose_error(self._X_measured, X)
