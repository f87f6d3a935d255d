"""The measurements and the parameters that are to explain them, every parameter in the unit of its prior."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robots.calibration.error_model import ZEROS, ErrorModel
from robots.calibration.loads import Loads
from robots.calibration.measurements import Measurements
from robots.calibration.solver.noise_model import Noise
from robots.calibration.yielding_joints import YIELDING_NAMES, Sag, YieldingJoints
from robots.pose import pose_error


@dataclass(frozen=True)
class Linearised:
    """Residuals at some parameters and how they change."""

    residuals: np.ndarray  # (n, k) measured less predicted: rad, m; rotation first
    A: np.ndarray  # (n, k, m) derivative of the prediction by the scaled parameters
    J: np.ndarray  # (n, k, 6) derivative of the prediction by the joint positions

    def select(self, rows: np.ndarray) -> "Linearised":
        """Some of the rows, by a mask or by indices."""
        return Linearised(self.residuals[rows], self.A[rows], self.J[rows])

    def triangle(self, noise: Noise) -> np.ndarray:
        """R with R^T R = A^T V^-1 A, the information of rows with this noise, (any, m)."""
        return np.asarray(
            np.linalg.qr((noise.whitening(self.J) @ self.A).reshape(-1, self.A.shape[2]), mode="r")
        )


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
        self._yielding = YieldingJoints(model, loads) if loads else None
        self._X_measured = measurements.X_WE
        self.rows = slice(3, 6) if measurements.rotation is None else slice(0, 6)
        self.names = (*model.names, *(YIELDING_NAMES if loads else ()))

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
        x = self.parameters(u)
        theta, sag = self.measurements.q, self._sag(x)
        q = sag.q if sag else theta
        return self._compared(self.model.forward(q, x[: len(self.model)], theta))

    def linearise(self, u: np.ndarray) -> Linearised:
        """Residuals with their derivatives."""
        x = self.parameters(u)
        theta, sag = self.measurements.q, self._sag(x)
        q = sag.q if sag else theta
        chain, Theta = self.model.chain_and_regressor(q, x[: len(self.model)], theta)
        J, A = Theta[:, self.rows, ZEROS], Theta
        if sag and self._yielding:
            A = np.concatenate(self._yielding.columns(chain, Theta, x[len(self.model) :], sag), axis=-1)
        A = A[:, self.rows][:, :, self.columns] * self.sizes[self.columns]
        return Linearised(self._compared(chain.X_WE), A, J)

    def _sag(self, x: np.ndarray) -> Sag | None:
        """What bends the joints; None for stiff ones."""
        if self._yielding is None:
            return None
        return self._yielding.sag(self.measurements.q, *np.split(x, [len(self.model)]))

    def _compared(self, X: np.ndarray) -> np.ndarray:
        if self.width == 3:
            return self.measurements.position - X[:, :3, 3]
        return pose_error(self._X_measured, X)
