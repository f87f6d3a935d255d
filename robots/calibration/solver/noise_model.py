"""How the noise of an instrument reaches the rows of a table.

V_n = theta_q s_q^2 J_n J_n^T + theta_p s_p^2 I_p + theta_r s_r^2 I_r: noise of the joint sensors reaches the
tool through the Jacobian, that of the instrument adds to position and rotation. The s are one, or how the
table says that rows differ, with a mean square of one; the theta are variances, known or to be found.
"""

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from robots.calibration.measurements import MeasurementNoise, Measurements

JOINT, POSITION, ROTATION = 0, 1, 2  # the components
FLOOR = 1e-13  # m or rad: below it there is rounding only
_SHARE_OF_RMS = 0.05  # no instrument is better than this share of the residuals


class Noise(Protocol):
    """What the solver asks of a model of noise with c components."""

    @property
    def theta(self) -> np.ndarray:
        """Variances of the components, (c,)."""
        ...

    @property
    def shape(self) -> np.ndarray:
        """What they are multiplied by, number for number or row for row."""
        ...

    def with_variances(self, theta: np.ndarray) -> Self:
        """See `NoiseModel.with_variances`."""
        ...

    def whitening(self, J: np.ndarray) -> np.ndarray:
        """See `NoiseModel.whitening`."""
        ...

    def halves(self, W: np.ndarray, J: np.ndarray) -> list[np.ndarray]:
        """See `NoiseModel.halves`."""
        ...

    def floors(self, residuals: np.ndarray) -> np.ndarray:
        """See `NoiseModel.floors`."""
        ...


@dataclass(frozen=True)
class NoiseModel:
    """Variances of a table's rows, with n rows of k numbers."""

    theta: np.ndarray  # (3,) variances of joint, position and rotation: rad^2, m^2, rad^2
    shape: np.ndarray  # (n, 3) what they are multiplied by, row for row

    def with_variances(self, theta: np.ndarray) -> Self:
        """The same rows with other variances."""
        return replace(self, theta=theta)

    def select(self, rows: np.ndarray) -> "NoiseModel":
        """Some of the rows."""
        return replace(self, shape=self.shape[rows])

    def whitening(self, J: np.ndarray) -> np.ndarray:
        """Matrices (n, k, k) that make rows white, for Jacobians of the joints (n, k, 6)."""
        variance = self.theta * self.shape
        width = J.shape[1]
        V = variance[:, JOINT, None, None] * (J @ np.swapaxes(J, 1, 2))
        diagonal = np.repeat(variance[:, [ROTATION, POSITION]], 3, axis=1)[:, 6 - width :]
        V[:, np.arange(width), np.arange(width)] += diagonal
        return np.linalg.inv(np.linalg.cholesky(V))

    def halves(self, W: np.ndarray, J: np.ndarray) -> list[np.ndarray]:
        """Factors H_i with W Q_i W^T = H_i H_i^T, Q_i the share of component i in V."""
        root = np.sqrt(self.shape)[:, :, None, None]
        position = W[:, :, -3:]
        rotation = W[:, :, :-3]
        return [root[:, JOINT] * (W @ J), root[:, POSITION] * position, root[:, ROTATION] * rotation]

    def floors(self, residuals: np.ndarray) -> np.ndarray:
        """The least variances (3,) for residuals (n, k).

        No instrument is perfect: its variance is known badly when that of the joints is large.
        """
        least = np.zeros(3)
        for component, part in ((POSITION, residuals[:, -3:]), (ROTATION, residuals[:, :-3])):
            if part.size:
                least[component] = max(_SHARE_OF_RMS**2 * float(np.mean(part**2)), FLOOR**2)
        return least

    def as_noise(self) -> MeasurementNoise:
        """Standard deviations."""
        return MeasurementNoise(*np.sqrt(self.theta).tolist())


@dataclass(frozen=True)
class RowSigmas:
    """What a table says of the noise of its n rows, component by component."""

    shape: np.ndarray  # (n, 3) variances by their mean; one where it says nothing
    theta: np.ndarray  # (3,) means of the variances in rad^2, m^2, rad^2; one where it says nothing
    named: np.ndarray  # (3,) bool, which it says


def row_sigmas(measurements: Measurements) -> RowSigmas:
    """Divides what a table says of its rows into how noisy they are in the mean and how they differ."""
    sigmas = measurements.sigmas
    if not len(sigmas):
        return RowSigmas(np.ones((len(measurements), 3)), np.ones(3), np.zeros(3, dtype=bool))
    named = np.asarray(np.all(np.isfinite(sigmas), axis=0))
    variances = np.where(named, np.maximum(np.nan_to_num(sigmas), FLOOR) ** 2, 1.0)
    theta = variances.mean(axis=0)
    return RowSigmas(variances / theta, theta, named)
