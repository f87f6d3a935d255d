"""Noise of the joints, shared by the lines of a configuration, and of every instrument."""

from dataclasses import dataclass, replace

import numpy as np

from robots.calibration.instruments.problem import InstrumentProblem
from robots.calibration.solver.noise_model import FLOOR

JOINT = 0  # the first component; instruments follow in their order
_SHARE_OF_RMS = 0.05  # no instrument is better than this share of its residuals


@dataclass(frozen=True)
class InstrumentNoise:
    """Variances of n configurations with k numbers each."""

    theta: np.ndarray  # (1 + instruments,) variances: rad^2, then m^2
    shape: np.ndarray  # (n, k) what that of the instrument is multiplied by; one where nothing was measured
    instrument: np.ndarray  # (n, k) indices; -1 where nothing was measured

    def with_variances(self, theta: np.ndarray) -> "InstrumentNoise":
        """The same rows with other variances."""
        return replace(self, theta=theta)

    def whitening(self, J: np.ndarray) -> np.ndarray:
        """Matrices (n, k, k) that make rows white, for Jacobians of the joints (n, k, 6)."""
        V = self.theta[JOINT] * (J @ np.swapaxes(J, 1, 2))
        own = np.append(self.theta[1:], 1.0)[self.instrument] * self.shape
        k = np.arange(V.shape[1])
        V[:, k, k] += own
        return np.linalg.inv(np.linalg.cholesky(V))

    def halves(self, W: np.ndarray, J: np.ndarray) -> list[np.ndarray]:
        """Factors H_i with W Q_i W^T = H_i H_i^T, Q_i the share of component i in V."""
        parts = [W @ J]
        for i in range(len(self.theta) - 1):
            own = np.where(self.instrument == i, np.sqrt(self.shape), 0.0)
            parts.append(W * own[:, None, :])
        return parts

    def floors(self, residuals: np.ndarray) -> np.ndarray:
        """The least variance of every component, by what is left of its rows."""
        least = [0.0]
        for i in range(len(self.theta) - 1):
            own = residuals[self.instrument == i]
            least.append(max(_SHARE_OF_RMS**2 * float(np.mean(own**2)) if own.size else 0.0, FLOOR**2))
        return np.array(least)


def instrument_noise(problem: InstrumentProblem, theta: np.ndarray, active: np.ndarray) -> InstrumentNoise:
    """The noise of the numbers that are compared.

    Args:
        problem: with the lines.
        theta: variances to begin with; what lines say of themselves is relative to it.
        active: which numbers are compared, (m, 3) bool.
    """
    seen = problem.observations
    differs = np.maximum(seen.sigma, FLOOR) ** 2 / theta[1 + seen.instrument]
    shape = problem.spread(np.where(active & np.isfinite(differs)[:, None], differs[:, None], 1.0))
    which = problem.spread(np.where(active, seen.instrument[:, None] + 1.0, 0.0)).astype(int) - 1
    return InstrumentNoise(theta, np.where(which < 0, 1.0, shape), which)
