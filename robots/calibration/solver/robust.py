"""Rows with gross errors that hide each other: a start that ignores them, and tests that name them.

Least squares bends towards the bad rows until none of them stands out. So the fit starts from the least sum
of distances, which few bad rows do not move; least trimmed squares find a clean core; and rows come back
one after the other as long as the core predicts them.
"""

import numpy as np
from scipy.special import fdtrc

from robots.calibration.solver.levenberg_marquardt import minimise
from robots.calibration.solver.noise_model import FLOOR, POSITION, ROTATION, NoiseModel
from robots.calibration.solver.problem import Linearised, Problem

_MEDIAN_CHI2_3 = 2.366  # median of chi square with three degrees of freedom
_L1_ROUNDS = 25
_NEAREST = 0.05  # of the median distance: no row weighs more than one at that distance
_SEEN = 0.3  # directions that the data show better than the prior does, in units of the prior
_TRIMMED = 0.25  # share of the rows that least trimmed squares leave out
_STARTS, _FINALISTS, _CONCENTRATIONS = 300, 20, 12
_RISK = 0.005  # that a clean table loses a row
_GROSS = 2e-5  # m or rad: what is less is no gross error, however quiet the other rows are
_BELONGS = 0.7  # of how far clean rows say that others are off: what is nearer to all rows belongs to them
_FAR = 20.0  # times the median distance in least squares: gross, whatever the model lacks


def least_distances(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Parameters with the least sum of the rows' distances, by reweighting.

    Returns:
        Scaled parameters (m,), and the variances (3,) of position and rotation as their medians are.
    """
    n, width = len(problem), problem.width
    u, weights = np.zeros(len(problem.columns)), np.ones(n)
    theta = np.array([0.0, 1e-6, 1e-6])
    for turn in range(_L1_ROUNDS):
        noise = NoiseModel(theta, np.ones((n, 3)))
        fit = minimise(problem, u, noise, weights, most=1 if turn else 3)
        u, e = fit.u, fit.at.residuals
        spread = np.sqrt(np.repeat(theta[[ROTATION, POSITION]], 3)[6 - width :])
        distance = np.linalg.norm(e / spread, axis=1)
        middle = float(np.median(distance))
        weights = middle / np.maximum(distance, _NEAREST * middle + 1e-300) if middle > 0.0 else np.ones(n)
        parts = [np.median(np.sum(e[:, -3:] ** 2, 1))]
        parts.append(np.median(np.sum(e[:, :-3] ** 2, 1)) if width == 6 else 1.0)
        theta = np.array([0.0, *np.maximum(np.array(parts) / _MEDIAN_CHI2_3, FLOOR**2)])
    return u, theta


def lacks_something(
    problem: Problem, noise: NoiseModel, least: np.ndarray, found: np.ndarray, clean: np.ndarray
) -> np.ndarray | None:
    """Tells rows with gross errors from rows that show what the model lacks.

    A gross error fits to nothing: the least sum of distances leaves the row as far off as the clean rows say.
    Where the model lacks something, such as springs, it may explain some rows to the noise by parameters that
    are wrong for all others. These seem far off then, and yet all rows together have a place for them.

    Args:
        problem: predicts the rows.
        noise: to weigh rotation against position.
        least: parameters with the least sum of distances, (m,).
        found: parameters of the clean rows, (m,).
        clean: rows that these parameters explain, (n,) bool.

    Returns:
        The rows to be used if the model lacks something, (n,) bool; None if the others have gross errors.
    """
    if clean.all():
        return None
    together, apart = _distances(problem, least), _distances(problem, found)
    if np.median(together[~clean] / np.maximum(apart[~clean], 1e-300)) > _BELONGS:
        return None
    squares = _distances(problem, minimise(problem, least, noise, np.ones(len(clean)), is_rough=True).u)
    return together <= _FAR * np.median(squares)


def _distances(problem: Problem, u: np.ndarray) -> np.ndarray:
    return np.linalg.norm(problem.residuals(u)[:, -3:], axis=1)


class CleanRows:
    """The rows of one linearisation, in the directions that they show."""

    def __init__(self, at: Linearised, u: np.ndarray, noise: NoiseModel, believed: float = 0.0) -> None:
        """Finds the directions.

        Args:
            at: the rows.
            u: parameters where they are, in units of the prior, (m,).
            noise: their variances.
            believed: how many numbers more this noise counts as, where the rows hardly tell it.
        """
        self._believed = believed
        W = noise.whitening(at.J)
        A, self._e = W @ at.A, at.residuals
        R = np.linalg.qr(A.reshape(-1, A.shape[2]), mode="r")
        _, s, Vt = np.linalg.svd(R, full_matrices=False)
        V = Vt[s > _SEEN].T
        self._G, self._raw = A @ V, at.A @ V  # (n, k, r)
        self._y = np.einsum("nij,nj->ni", W, at.residuals)
        self._prior = -(V.T @ u)
        self._N = np.swapaxes(self._G, 1, 2) @ self._G
        self._v = np.einsum("nki,nk->ni", self._G, self._y)

    @property
    def num_directions(self) -> int:
        """How many directions the rows show better than the prior does; none where they fit to nothing."""
        return self._G.shape[2]

    def find(self, rng: np.random.Generator) -> np.ndarray:
        """The rows without gross errors, (n,) bool."""
        clean = self._core(rng)
        n = len(clean)
        while not clean.all():
            chance, _ = self._chances(clean)
            likely = np.flatnonzero(~clean & (chance >= _RISK / n))
            if not len(likely):
                break
            # One by one where there are few; a long table is taken back by quarters.
            best = likely[np.argsort(-chance[likely])]
            clean[best[: max(1, len(best) // 4)]] = True
        for _ in range(3):
            chance, is_controlled = self._chances(clean)
            chance = np.where(clean & is_controlled, chance, 1.0)
            worst = int(np.argmin(chance))
            if chance[worst] > _RISK / n:
                break
            clean[worst] = False
        return clean

    def _core(self, rng: np.random.Generator) -> np.ndarray:
        """Least trimmed squares on the linearised rows, with the prior: concentration steps, many starts."""
        n, k, r = self._G.shape
        kept = n - int(_TRIMMED * n)
        few = min(kept, r // k + 2)
        chosen = np.zeros((_STARTS, n))
        chosen[0, np.argsort(np.linalg.norm(self._y, axis=1))[:kept]] = 1.0
        for start in range(1, _STARTS):
            chosen[start, rng.choice(n, few, replace=False)] = 1.0
        order, cost = np.empty((0, kept), dtype=int), np.empty(0)
        for step in range(_CONCENTRATIONS):
            H = (chosen @ self._N.reshape(n, -1)).reshape(-1, r, r) + np.eye(r)
            d = np.linalg.solve(H, (chosen @ self._v + self._prior)[..., None])[..., 0]
            rest = self._y[None] - (self._G.reshape(-1, r) @ d.T).T.reshape(-1, n, k)
            squares = np.sum(rest**2, axis=2)
            order = np.argpartition(squares, kept - 1, axis=1)[:, :kept]
            cost = np.take_along_axis(squares, order, 1).sum(axis=1)
            if step == 2:
                finalists = np.argsort(cost)[:_FINALISTS]
                order, cost = order[finalists], cost[finalists]
            chosen = np.zeros((len(order), n))
            np.put_along_axis(chosen, order, 1.0, 1)
        core = np.zeros(n, dtype=bool)
        core[order[np.argmin(cost)]] = True
        return core

    def _chances(self, clean: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How likely each row is, given the clean ones, (n,), and whether others control it, (n,) bool.

        Fisher's F of the predicted residual: of rows inside by leaving them out, of others as they are.
        """
        _, k, r = self._G.shape
        H = np.linalg.inv(self._N[clean].sum(axis=0) + np.eye(r))
        d = H @ (self._v[clean].sum(axis=0) + self._prior)
        rest = self._y - self._G @ d
        hat = self._G @ H @ np.swapaxes(self._G, 1, 2)
        S = np.where(clean[:, None, None], np.eye(k) - hat, np.eye(k) + hat)
        is_controlled = ~clean | (np.linalg.eigvalsh(S)[:, 0] > 1e-6)
        S = np.where(is_controlled[:, None, None], S, np.eye(k))
        squared = np.sum(rest * np.linalg.solve(S, rest[..., None])[..., 0], axis=1)
        total = float(np.sum(rest[clean] ** 2)) + self._believed
        freedom = float(clean.sum() * k - (r - np.trace(H))) + self._believed
        inside = np.maximum(total - squared, 0.0) / max(freedom - k, 1.0)
        spread = np.where(clean, inside, total / max(freedom, 1.0))
        ratio = squared / k / np.maximum(spread, 1e-300)
        chance = fdtrc(k, np.where(clean, max(freedom - k, 1.0), max(freedom, 1.0)), ratio)
        is_small = np.abs(self._e - self._raw @ d).max(axis=1) < _GROSS
        return np.where(is_small, 1.0, chance), is_controlled
