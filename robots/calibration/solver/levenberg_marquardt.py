"""Levenberg-Marquardt with a prior: sum of whitened squares plus the squares of the scaled parameters.

Each step factors the whitened rows and the prior by QR and the small triangle by SVD, so that nothing is
squared and no rank is decided. scipy's `least_squares` does not know that the weights follow the Jacobian.
"""

from dataclasses import dataclass

import numpy as np

from robots.calibration.solver.noise_model import Noise
from robots.calibration.solver.problem import Linearised, Predicted

_NEGLIGIBLE = 1e-14  # singular values below this share of the largest are rounding
_LARGEST_DAMPING = 1e14
_FLAT = 1e-12  # of the cost: what a full step would gain where the prior alone still moves along a valley
_STILL = 1e-13  # of a step in units of the prior
_ROUNDING = 1e-9  # steps below this may raise the cost by rounding
_FRACTIONS = {"rough": 0.3, "usual": 1e-3, "exact": 1e-4}  # of the noise that a last step may have


@dataclass(frozen=True)
class Fit:
    """A minimum, or where the search for it ended."""

    u: np.ndarray  # (m,) free parameters in units of the prior
    at: Linearised
    is_converged: bool
    iterations: int


def minimise(
    problem: Predicted,
    start: np.ndarray,
    noise: Noise,
    weights: np.ndarray,
    most: int = 60,
    is_rough: bool = False,
) -> Fit:
    """Minimises sum_n w_n |W_n e_n|^2 + |u|^2.

    Args:
        problem: predicts the rows.
        start: scaled parameters to begin with, (m,).
        noise: gives the whitening W_n, which stands still within a step.
        weights: w_n, (n,); zero leaves a row out.
        most: iterations.
        is_rough: whether to stop a third of the noise from the minimum.
    """
    u, at, damping = start, problem.linearise(start), 1e-4
    is_exact = noise.theta.max() * noise.shape.max() < 1e-20
    enough = _FRACTIONS["rough" if is_rough else "exact" if is_exact else "usual"]
    for iteration in range(1, most + 1):
        W = noise.whitening(at.J) * np.sqrt(weights)[:, None, None]
        S, y = _triangle(W, at, u)
        cost = float(y @ y)
        U, s, Vt = np.linalg.svd(S, full_matrices=False)
        c, keep = U.T @ y, s > _NEGLIGIBLE * s[0]
        if float(c @ c) <= _FLAT * cost:
            return Fit(u, at, True, iteration)
        while True:
            step = Vt.T @ (np.where(keep, s / (s * s + damping), 0.0) * c)
            largest = float(np.abs(step).max())
            tried = u + step
            e = problem.residuals(tried)
            found = float(np.sum(np.einsum("nij,nj->ni", W, e) ** 2) + tried @ tried)
            if found <= cost * (1.0 + 1e-10) or largest < _ROUNDING:
                break
            damping = max(10.0 * damping, 1e-6)
            if damping > _LARGEST_DAMPING:
                return Fit(u, at, False, iteration)
        damping = damping / 30.0 if damping > 1e-12 else 0.0
        u, at = tried, problem.linearise(tried)
        is_rounding = largest < _ROUNDING and found > 0.98 * cost
        if is_rounding or float(np.linalg.norm(S @ step)) < enough or largest < _STILL:
            return Fit(u, at, True, iteration)
    return Fit(u, at, False, most)


def _triangle(W: np.ndarray, at: Linearised, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangle of the whitened rows above the prior, and its right-hand side: S du = y."""
    m = len(u)
    rows = np.zeros((W.shape[0] * W.shape[1] + m, m + 1))
    rows[:-m, :-1] = (W @ at.A).reshape(-1, m)
    rows[:-m, -1] = np.einsum("nij,nj->ni", W, at.residuals).ravel()
    rows[-m:, :-1], rows[-m:, -1] = np.eye(m), -u
    R = np.asarray(np.linalg.qr(rows, mode="r"))
    return R[:, :-1], R[:, -1]
