"""How noisy joints, positions and rotations are, from the residuals alone: restricted maximum likelihood.

The parameters are random effects of unit size (they are scaled by their prior). With whitened rows A and
H = A^T V^-1 A + I, P = V^-1 - V^-1 A H^-1 A^T V^-1, g_i = e^T V^-1 Q_i V^-1 e, t_i = tr(P Q_i) and
F_ij = tr(P Q_i P Q_j), a step of Fisher's scoring is theta += F^-1 (g - t), Patterson and Thompson (1971).
"""

from dataclasses import dataclass

import numpy as np

from robots.calibration.solver.noise_model import JOINT, POSITION, ROTATION, Noise
from robots.calibration.solver.problem import Linearised

_SEEN = 0.1  # singular values below it, in units of the prior, take nothing from the degrees of freedom
_LEAST = 0.02  # of its former value: a component falls no faster


@dataclass(frozen=True)
class VarianceComponents:
    """Estimated variances and how well they are known."""

    theta: np.ndarray  # (3,) all components, those that are known as they were
    covariance: np.ndarray  # (c, c) of the estimated ones, in their order


@dataclass(frozen=True)
class _Whitened:
    """What the traces are made of, for the components that are estimated."""

    square: list[np.ndarray]  # W Q_i W^T, (n, k, k)
    HB: list[np.ndarray]  # W Q_i W^T B, (n k, r)
    M: list[np.ndarray]  # B^T W Q_i W^T B, (r, r)
    score: np.ndarray  # g_i - t_i


def variance_components(at: Linearised, noise: Noise, estimated: list[int]) -> VarianceComponents:
    """One step of scoring.

    Args:
        at: the rows that are kept, linearised at the estimate.
        noise: variances to start from.
        estimated: which components are not known.
    """
    theta = noise.theta.copy()
    parts = _whitened(at, noise, estimated)
    count = len(estimated)
    F = np.empty((count, count))
    for i in range(count):
        for j in range(count):
            F[i, j] = (
                np.sum(parts.square[i] * parts.square[j])
                - 2.0 * np.sum(parts.HB[i] * parts.HB[j])
                + np.sum(parts.M[i] * parts.M[j].T)
            )
    # A component that would turn negative falls to its floor, and the others are solved again.
    free, new = list(range(count)), theta[estimated]
    while free:
        new = theta[estimated]
        new[free] += np.linalg.solve(F[np.ix_(free, free)], parts.score[free])
        falling = [i for i in free if new[i] < _LEAST * theta[estimated[i]]]
        if not falling:
            break
        for i in falling:
            theta[estimated[i]] *= _LEAST
        free = [i for i in free if i not in falling]
    theta[estimated] = new if free else theta[estimated]
    theta[estimated] = np.maximum(theta, noise.floors(at.residuals))[estimated]
    return VarianceComponents(theta, 2.0 * np.linalg.inv(F))


def _whitened(at: Linearised, noise: Noise, estimated: list[int]) -> _Whitened:
    n, k, m = at.A.shape
    W = noise.whitening(at.J)
    A, e = (W @ at.A).reshape(-1, m), np.einsum("nij,nj->ni", W, at.residuals)
    _, s, Vt = np.linalg.svd(np.linalg.qr(A, mode="r"), full_matrices=False)
    seen = s > _SEEN
    flat = (A @ Vt[seen].T) / np.sqrt(s[seen] ** 2 + 1.0)
    B = flat.reshape(n, k, -1)
    halves = noise.halves(W, at.J)
    square, HB, M, score = [], [], [], []
    for i in estimated:
        H, Ht = halves[i], np.swapaxes(halves[i], 1, 2)
        square.append(H @ Ht)
        HB.append((H @ (Ht @ B)).reshape(-1, B.shape[2]))
        M.append(flat.T @ HB[-1])
        g = np.sum((Ht @ e[..., None]) ** 2)
        score.append(g - np.sum(H**2) + np.trace(M[-1]))
    return _Whitened(square, HB, M, np.array(score))


def parameter_factor(
    at: Linearised,
    noise: Noise,
    estimated: list[int],
    found: VarianceComponents | None,
) -> np.ndarray:
    """A factor F of the covariance F F^T of the parameters in units of their prior, (m, any).

    C = (A^T V^-1 A + I)^-1; where the noise is estimated, widened by what that costs, after Kenward and Roger
    (1997): C + 2 C [sum_ij w_ij (Q_ij - P_i C P_j)] C. Directions that the data do not show keep their prior.

    Args:
        at: the rows that were used, linearised at the estimate.
        noise: their variances.
        estimated: which components of the noise are estimates.
        found: how well these are known; None if all are known.
    """
    n, k, m = at.A.shape
    W = noise.whitening(at.J)
    A = (W @ at.A).reshape(-1, m)
    padded = np.vstack([A, np.zeros((max(0, m - len(A)), m))])
    _, s, Vt = np.linalg.svd(np.linalg.qr(padded, mode="r"))
    shown = Vt.T / np.sqrt(s * s + 1.0)
    if found is None:
        return shown
    # In coordinates in which C is the unit matrix nothing is lost by rounding.
    seen = s > _SEEN
    B = A @ shown[:, seen]
    halves = noise.halves(W, at.J)
    cube = B.reshape(n, k, -1)
    turned = [(halves[i] @ (np.swapaxes(halves[i], 1, 2) @ cube)).reshape(B.shape) for i in estimated]
    P = [B.T @ each for each in turned]
    inner = np.zeros((B.shape[1], B.shape[1]))
    for i in range(len(estimated)):
        for j in range(len(estimated)):
            inner += found.covariance[i, j] * (turned[i].T @ turned[j] - P[i] @ P[j])
    size, axes = np.linalg.eigh(inner + inner.T)
    # What the estimate of the noise adds is never negative; badly known variances can make it look so.
    wider = shown[:, seen] @ axes * np.sqrt(np.maximum(size, 0.0))
    return np.hstack([shown, wider])


def components_to_estimate(known: np.ndarray, has_rotation: bool, redundancy: int) -> list[int]:
    """Which variances residuals can tell apart.

    Args:
        known: which components are known, (3,) bool.
        has_rotation: whether orientations were measured.
        redundancy: numbers measured less parameters that they show.
    """
    found = [] if known[POSITION] else [POSITION]
    if has_rotation and not known[ROTATION]:
        found.append(ROTATION)
    # Noise of the joints looks like that of the instrument unless there is much of it to compare.
    if not known[JOINT] and redundancy >= 90:
        found.append(JOINT)
    return found
