"""Optimality criteria of measurement sets: observability index B3, D- and I-optimality.

Each criterion is written as a concave function of the information matrix M that grows in proportion with M.
A gradient G of such a function bounds it from above everywhere: value(M') <= tr(G M'). So no set of N
candidates is better than N times the largest tr(G Theta^T Theta) among them, whatever M the gradient is from.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from robots.description.model import RobotModel
from robots.measurement_design.candidate_grid import CandidateGrid

NAMES = ("b3", "d", "i")
_SHARE_SEEN = 1e-4  # of an eigenvalue in the gradient: a lesser one bends nothing
_WORKSPACE_SAMPLES = 500  # random configurations at which the I-criterion predicts the tool
# Standard deviations of one pose measurement, which weigh radians against metres: table 6.1 of Probst (2024).
POSITION_SIGMA = 1e-4  # m
ROTATION_SIGMA = np.deg2rad(0.03)  # rad


@dataclass(frozen=True)
class SecondOrder:
    """How a criterion changes with what is added to M, to the second order.

    Both ``slopes`` and ``bends`` are linear in what is added: a step with the slope s and the bends b,
    differences of those of single measurements where these are exchanged, adds s + (lift s^2 - |b|^2) / 2.
    """

    slopes: np.ndarray  # (n,) of n measurements
    bends: np.ndarray  # (n, any)
    lift: float


class Criterion(ABC):
    """A criterion to be maximised; M is an information matrix in m and rad, or a stack of them."""

    label: str

    @abstractmethod
    def value(self, M: np.ndarray) -> np.ndarray:
        """The criterion of information matrices (..., n, n), shape (...)."""

    @abstractmethod
    def gradient_root(self, M: np.ndarray) -> np.ndarray:
        """A matrix R (n, r) for which R R^T is the gradient at M (n, n), or nearly."""

    @abstractmethod
    def second_order(self, M: np.ndarray, information: np.ndarray) -> SecondOrder:
        """What each of some information matrices (k, n, n) would add to the criterion at M (n, n)."""


class SmallestEigenvalue(Criterion):
    """B3, the smallest eigenvalue of M, Probst (2024) section 4.2: the worst direction of the parameters.

    Where several eigenvalues are nearly the smallest, its gradient says little of what happens a step away.
    The eigenvectors of all of them are therefore mixed, the more the smaller ``sharpness`` is.
    """

    label = "B3"

    def __init__(self, sharpness: float = 100.0) -> None:
        self.sharpness = sharpness  # in units of 1 / B3

    def value(self, M: np.ndarray) -> np.ndarray:
        """The smallest eigenvalues, (..., n, n) -> (...)."""
        return np.linalg.eigvalsh(M)[..., 0]

    def gradient_root(self, M: np.ndarray) -> np.ndarray:
        """The gradient of the soft minimum of the eigenvalues; its trace is one, so it bounds B3 too."""
        _, vectors, shares, _ = self._shares(M)
        kept = shares > 1e-9
        return vectors[:, kept] * np.sqrt(shares[kept] / shares[kept].sum())

    def second_order(self, M: np.ndarray, information: np.ndarray) -> SecondOrder:
        """Of the soft minimum -log(sum exp(-s eigenvalue)) / s, by divided differences of its shares."""
        eigenvalues, vectors, shares, sharpness = self._shares(M)
        few = int(np.sum(shares > _SHARE_SEEN))
        # Row by row of the small eigenvalues: those of large ones among each other change nothing.
        turned = (vectors[:, :few].T @ information) @ vectors
        apart = eigenvalues - eigenvalues[:few, None]
        is_same = np.abs(apart) < 1e-9 * eigenvalues[-1]
        fall = (shares[:few, None] - shares) / np.where(is_same, 1.0, apart)
        weights = np.where(is_same, sharpness * shares[:few, None], fall)
        weights[:, few:] *= 2.0  # which stand below the diagonal once more
        bends = turned * np.sqrt(np.maximum(weights, 0.0))
        slopes = np.einsum("nkk,k->n", turned[..., :few], shares[:few])
        return SecondOrder(slopes, bends.reshape(len(bends), -1), sharpness)

    def _shares(self, M: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Eigenvalues, eigenvectors, the shares of these in the gradient, the sharpness in 1 / eigenvalue."""
        eigenvalues, vectors = np.linalg.eigh(M)
        sharpness = self.sharpness / max(eigenvalues[0], 1e-9 * eigenvalues[-1])
        shares = np.exp(-sharpness * (eigenvalues - eigenvalues[0]))
        return eigenvalues, vectors, shares / shares.sum(), sharpness


class Determinant(Criterion):
    """D-optimality, det(M)^(1/n): the volume of the confidence ellipsoid of the parameters."""

    label = "D"

    def value(self, M: np.ndarray) -> np.ndarray:
        """The n-th roots of the determinants, zero for singular matrices, (..., n, n) -> (...)."""
        _, logarithm = np.linalg.slogdet(M)
        return np.exp(logarithm / M.shape[-1])

    def gradient_root(self, M: np.ndarray) -> np.ndarray:
        """value(M) M^-1 / n, factorised."""
        eigenvalues, vectors = np.linalg.eigh(M)
        return vectors * np.sqrt(self.value(M) / (len(M) * eigenvalues))

    def second_order(self, M: np.ndarray, information: np.ndarray) -> SecondOrder:
        """With f = det(M)^(1/n) and M^-1 = L L^T: f tr(L^T A L) / n, bent by |L^T A L|^2 f / n."""
        root = self.gradient_root(M)
        turned = root.T @ information @ root
        f = float(self.value(M))
        bends = turned.reshape(len(turned), -1) * np.sqrt(len(M) / f)
        return SecondOrder(np.trace(turned, axis1=1, axis2=2), bends, 1.0 / f)


class PoseVariance(Criterion):
    """I-optimality: the inverse of the mean variance of the predicted pose over the workspace.

    The variance is that of six whitened coordinates, position over 0.1 mm and rotation over 0.03 degrees,
    the standard deviations of table 6.1, or of the position alone where only that is measured. Measurements
    weigh as in the other criteria, in m and rad.
    """

    label = "I"

    def __init__(self, robot: RobotModel, grid: CandidateGrid) -> None:
        q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (_WORKSPACE_SAMPLES, 6))
        Theta = grid.regressor(q)
        sigmas = np.repeat([ROTATION_SIGMA, POSITION_SIGMA], 3)[-Theta.shape[1] :]
        whitened = (Theta / sigmas[:, None]).reshape(-1, grid.parameters.rank)
        self._spread = whitened.T @ whitened / _WORKSPACE_SAMPLES
        self._root = np.linalg.cholesky(self._spread)

    def value(self, M: np.ndarray) -> np.ndarray:
        """1 / tr(spread M^-1), (..., n, n) -> (...)."""
        return 1.0 / np.einsum("ij,...ji->...", self._spread, np.linalg.inv(M))

    def gradient_root(self, M: np.ndarray) -> np.ndarray:
        """value(M) M^-1 spread^(1/2)."""
        return self.value(M) * np.linalg.solve(M, self._root)

    def second_order(self, M: np.ndarray, information: np.ndarray) -> SecondOrder:
        """With f = 1 / tr(C^T M^-1 C) and R = f M^-1 C: tr(R^T A R), bent by 2 |R^T A L|^2, M^-1 = L L^T."""
        root = self.gradient_root(M)
        L = np.linalg.inv(np.linalg.cholesky(M)).T
        turned = root.T @ information
        slopes = np.einsum("nij,ji->n", turned, root)
        return SecondOrder(
            slopes, np.sqrt(2.0) * (turned @ L).reshape(len(turned), -1), 2.0 / float(self.value(M))
        )


def criterion(name: str, robot: RobotModel, grid: CandidateGrid) -> Criterion:
    """The criterion of a name, one of `NAMES`.

    Raises:
        ValueError: if there is no such criterion.
    """
    if name == "b3":
        return SmallestEigenvalue()
    if name == "d":
        return Determinant()
    if name == "i":
        return PoseVariance(robot, grid)
    raise ValueError(f"criterion must be one of {', '.join(NAMES)}, got '{name}'")
