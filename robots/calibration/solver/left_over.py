"""What a fit leaves over: how large it is beside the noise, and whether it follows the torques of gravity."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import fdtrc

from robots.calibration.solver.noise_belief import taken
from robots.calibration.solver.noise_model import Noise
from robots.calibration.solver.problem import Linearised, Predicted
from robots.description.model import NUM_JOINTS

_RISK = 1e-4  # that noise alone is taken for springs
_SEEN = 1e-6  # of its length: a column of which the other parameters leave no more says nothing of its own
_ROUNDING = 1e-7  # m: what is smaller is not told from rounding


class Yielding(Predicted, Protocol):
    """A problem in which compliances of the joints, then errors of masses, follow all other parameters."""

    columns: np.ndarray  # which parameters are free


@dataclass(frozen=True)
class GravityTest:
    """Whether compliances that were not sought would explain what is left."""

    chance: float  # that noise alone follows the torques of gravity as closely
    explained: float  # m, rms over the points, by which they would be nearer to where they were measured

    @property
    def is_clear(self) -> bool:
        """Whether what is left is not noise alone, and gravity has a part in it."""
        return self.chance < _RISK and self.explained > _ROUNDING


def misfit(at: Linearised, noise: Noise) -> float:
    """Size of the residuals in units of the noise: about one where the noise explains them."""
    whitened = np.einsum("nij,nj->ni", noise.whitening(at.J), at.residuals)
    return float(np.sqrt(np.sum(whitened**2) / max(whitened.size - taken(at, noise), 1.0)))


def gravity_test(
    at: Linearised, u: np.ndarray, springs: np.ndarray, noise: Noise, measured: np.ndarray | None = None
) -> GravityTest:
    """The F test of columns that a linear fit does not have; its noise may have any size.

    Args:
        at: the fit, linearised where it is best.
        u: its scaled parameters, (m,); their prior counts as m more numbers.
        springs: derivatives of the prediction by compliances, (n, k, c).
        noise: of the rows.
        measured: which numbers were, (n, k) bool, where a row holds several points, three numbers each; None
            where it is a pose or a position.
    """
    n, k, m = at.A.shape
    points = np.ones((n, 1, 3), dtype=bool) if measured is None else measured.reshape(n, -1, 3)
    numbers = n * k if measured is None else int(measured.sum())
    W = noise.whitening(at.J)
    Q, R = np.linalg.qr(np.vstack([(W @ at.A).reshape(-1, m), np.eye(m)]))
    columns = np.vstack([(W @ springs).reshape(n * k, -1), np.zeros((m, springs.shape[2]))])
    left = np.concatenate([np.einsum("nij,nj->ni", W, at.residuals).ravel(), -u])
    lengths = np.linalg.norm(columns, axis=0)
    seen = lengths > 0.0  # gravity does not turn an upright axis
    columns, springs = columns[:, seen] / lengths[seen], springs[:, :, seen] / lengths[seen]
    U, s, Vt = np.linalg.svd(columns - Q @ (Q.T @ columns), full_matrices=False)
    U, s, Vt = (part[..., s > _SEEN] for part in (U, s, Vt.T))
    left = left - Q @ (Q.T @ left)
    along = U.T @ left
    rest = float(left @ left - along @ along)
    spare = numbers - taken(at, noise) - len(s)
    if not len(s) or spare < 1.0 or not rest > 0.0:
        return GravityTest(1.0, 0.0)
    found = Vt @ (along / s)
    taken_over = solve_triangular(R, Q.T @ (columns @ found), check_finite=False)  # by the other parameters
    change = (springs @ found - at.A @ taken_over)[:, -points[0].size :]
    chance = float(fdtrc(len(s), spare, (along @ along / len(s)) / (rest / spare)))
    return GravityTest(chance, float(np.sqrt(np.sum(change**2) / points.any(axis=2).sum())))


def spring_columns(yielding: Yielding, u: np.ndarray) -> np.ndarray:
    """Derivatives of the rows by scaled compliances, (n, k, 6), where a stiff robot has the parameters u."""
    stiff = np.zeros(len(yielding.columns))
    stiff[: len(u)] = u
    return yielding.linearise(stiff).A[:, :, len(u) : len(u) + NUM_JOINTS]
