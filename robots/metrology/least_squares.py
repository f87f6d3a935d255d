"""Statistics of least-squares fits: degrees of freedom, covariance, confidence, outliers.

A fit has n measurements of k numbers each (a point has three, a pose six) and m parameters. Residuals and
Jacobians come whitened, that is divided by the standard deviation that is expected of them, or all alike;
``sigma`` is then the factor by which they really scatter.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc, fdtri, stdtrit

_OUTLIER_RISK = 0.01  # chance that a set without outliers is said to have one
_UNCONTROLLED = 1e-6  # redundancy (0 to 1) of a direction that no other measurement controls


class UndeterminedError(ValueError):
    """Measurements that contradict each other or do not determine what is asked of them.

    ``rows`` are the measurements to blame, counted from zero; empty if it is all of them. Where there are
    several sets of measurements, ``part`` is the number of the set, from zero too.
    """

    def __init__(self, message: str, rows: Sequence[int] = (), part: int = 0) -> None:
        super().__init__(message)
        self.rows = tuple(rows)
        self.part = part


@dataclass(frozen=True)
class FitStatistics:
    """The spread of the residuals and what follows from it; NaN where no redundancy shows it."""

    degrees_of_freedom: int  # n k - m
    sigma: float  # standard deviation of one residual: sqrt(r^T r / degrees_of_freedom)
    covariance: np.ndarray  # of the parameters, (m, m)
    outliers: tuple[int, ...]  # measurements that do not belong to the rest, the worst first

    @property
    def standard_deviations(self) -> np.ndarray:
        """Standard deviations of the parameters, shape (m,)."""
        return np.sqrt(np.diag(self.covariance))

    def half_widths(self, level: float = 0.95) -> np.ndarray:
        """Half the confidence interval of each parameter by itself (Student's t), shape (m,)."""
        if self.degrees_of_freedom == 0:
            return np.full(len(self.covariance), np.nan)
        return stdtrit(self.degrees_of_freedom, 0.5 + 0.5 * level) * self.standard_deviations

    def covers(self, error: np.ndarray, parameters: slice, level: float = 0.95) -> bool:
        """Whether an error of some parameters lies in their joint confidence ellipsoid (Fisher's F)."""
        size = len(error)
        distance = error @ np.linalg.solve(self.covariance[parameters, parameters], error) / size
        return bool(distance <= fdtri(size, self.degrees_of_freedom, level))


def fit_statistics(jacobian: np.ndarray, residual: np.ndarray, negligible: float) -> FitStatistics:
    """Statistics of a linear fit, or of a nonlinear one at its solution.

    Args:
        jacobian: derivatives of the model by the parameters, whitened, shape (n, k, m).
        residual: measured minus modelled, whitened, shape (n, k).
        negligible: a sigma below which residuals are rounding, and none of them is an outlier.
    """
    freedom = residual.size - jacobian.shape[-1]
    sigma = float(np.sqrt(np.sum(residual**2) / freedom)) if freedom > 0 else float("nan")
    root = np.linalg.pinv(jacobian.reshape(residual.size, -1))
    outliers = _outliers(jacobian, residual, negligible)
    return FitStatistics(freedom, sigma, sigma**2 * (root @ root.T), outliers)


def _outliers(jacobian: np.ndarray, residual: np.ndarray, negligible: float) -> tuple[int, ...]:
    """Takes out the worst measurement and fits again, as long as the fit gains more than chance would give.

    How much the fit gains by leaving one out follows from that fit alone, and its ratio to what remains
    is Fisher's F. The risk is shared by the n measurements (Bonferroni), since the worst of them is tested.
    """
    kept = np.arange(len(residual))
    found: list[int] = []
    while True:
        J, (n, size) = jacobian[kept], residual[kept].shape
        remaining = n * size - J.shape[-1] - size  # degrees of freedom without one of them
        if remaining < 1:
            break
        Q = np.linalg.qr(J.reshape(n * size, -1))[0]
        r = residual[kept].ravel()
        r = r - Q @ (Q.T @ r)
        if r @ r <= (remaining + size) * negligible**2:
            break
        gain = _gain_without_one(Q.reshape(n, size, -1), r.reshape(n, size))
        rest = np.maximum(r @ r - gain, np.finfo(float).tiny)
        chance = fdtrc(size, remaining, (gain / size) / (rest / remaining))
        worst = int(np.argmin(chance))
        if chance[worst] * n > _OUTLIER_RISK:
            break
        found.append(int(kept[worst]))
        kept = np.delete(kept, worst)
    return tuple(found)


def _gain_without_one(Q: np.ndarray, r: np.ndarray) -> np.ndarray:
    """The fall of r^T r when measurement i is left out, shape (n,): r_i^T (I - Q_i Q_i^T)^-1 r_i."""
    redundancy, axes = np.linalg.eigh(np.eye(r.shape[-1]) - Q @ np.swapaxes(Q, -1, -2))
    along = np.einsum("nij,ni->nj", axes, r)
    # A direction that nothing else controls has no residual: leaving it out gains nothing.
    controlled = redundancy > _UNCONTROLLED
    return np.sum(np.where(controlled, along**2 / np.where(controlled, redundancy, 1.0), 0.0), axis=-1)
