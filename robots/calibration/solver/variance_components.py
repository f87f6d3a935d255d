"""How noisy joints, positions and rotations are, from the residuals alone: restricted maximum likelihood.

The parameters are random effects of unit size (they are scaled by their prior). With whitened rows A and
H = A^T V^-1 A + I, P = V^-1 - V^-1 A H^-1 A^T V^-1, g_i = e^T V^-1 Q_i V^-1 e, t_i = tr(P Q_i) and
F_ij = tr(P Q_i P Q_j), a step of Fisher's scoring is theta += F^-1 (g - t), Patterson and Thompson (1971).
Steps are damped until log det V + log det H + e^T V^-1 e + |u|^2, minus twice the logarithm of the restricted
likelihood, falls: where one kind of noise hides another, bare scoring goes in circles.

Rows with hardly more numbers than parameters cannot tell kinds of noise apart: F is singular then (of rank
one where one number is left over), and rounding may give it negative eigenvalues. A ten-thousandth of
tr(V^-1 Q_i V^-1 Q_i), which F_ii would be without parameters, is added to its diagonal: a weak belief in the
size of a variance that weighs nothing where there is something to be seen.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from robots.calibration.solver.noise_belief import WEIGHT
from robots.calibration.solver.noise_model import JOINT, POSITION, ROTATION, Noise
from robots.calibration.solver.problem import Linearised

_SEEN = 0.1  # singular values below it, in units of the prior, widen no covariance
_LEAST = 0.02  # of its former value: a component falls no faster
_STEPS = 40
_SETTLED = 0.005  # of its own standard deviation: a last step
_DAMPING_FROM, _LARGEST_DAMPING = 0.1, 1e6  # of the information
_ROUNDING = 1e-9  # by which the likelihood may be wrong
_BELIEVED = 1e-4  # of the information that there would be without parameters


@dataclass(frozen=True)
class VarianceComponents:
    """Estimated variances and how well they are known."""

    theta: np.ndarray  # (3,) all components, those that are known as they were
    covariance: np.ndarray  # (c, c) of the estimated ones, in their order


@dataclass(frozen=True)
class _Likelihood:
    """Minus twice the logarithm of the restricted likelihood at some variances, and how it falls."""

    value: float
    score: np.ndarray  # (c,) g_i - t_i of the estimated components
    information: np.ndarray  # (c, c) F, positive definite


def variance_components(
    at: Linearised, u: np.ndarray, noise: Noise, estimated: list[int], belief: np.ndarray | None = None
) -> VarianceComponents:
    """The most likely variances where residuals change linearly with the parameters.

    Args:
        at: the rows that are kept, linearised.
        u: the parameters where they are, in units of the prior, (m,).
        noise: variances to start from.
        estimated: which components are not known.
        belief: variances (3,), each as if one more number of its kind had been seen; see `noise_belief`.
    """
    y = at.residuals + at.A @ u  # what the parameters and the noise have to explain
    least = noise.floors(at.residuals)[estimated]
    theta = noise.theta.copy()
    theta[estimated] = np.maximum(theta[estimated], least)
    now, damping = _likelihood(at, y, noise.with_variances(theta), estimated, belief), 0.0
    for _ in range(_STEPS):
        before = theta[estimated]
        free = np.flatnonzero((before > least) | (now.score > 0.0))
        if not len(free):
            break
        F = now.information[np.ix_(free, free)]
        step = np.zeros(len(estimated))
        step[free] = np.linalg.solve(F + damping * np.diag(np.diagonal(F)), now.score[free])
        tried = theta.copy()
        tried[estimated] = np.maximum(before + step, np.maximum(_LEAST * before, least))
        there = _likelihood(at, y, noise.with_variances(tried), estimated, belief)
        change = np.abs(tried[estimated] - before)[free]
        is_last = bool(np.all(change < _SETTLED * np.sqrt(2.0 * np.diagonal(np.linalg.inv(F)))))
        if there.value <= now.value + _ROUNDING * abs(now.value):
            theta, now, damping = tried, there, damping / 10.0 if damping > _DAMPING_FROM else 0.0
        else:
            damping = max(10.0 * damping, _DAMPING_FROM)
        if is_last or damping > _LARGEST_DAMPING:
            break
    return VarianceComponents(theta, 2.0 * np.linalg.inv(now.information))


def _likelihood(
    at: Linearised, y: np.ndarray, noise: Noise, estimated: list[int], belief: np.ndarray | None
) -> _Likelihood:
    n, k, m = at.A.shape
    W = noise.whitening(at.J)
    A, y = (W @ at.A).reshape(-1, m), np.einsum("nij,nj->ni", W, y).ravel()
    R = np.asarray(np.linalg.qr(np.vstack([A, np.eye(m)]), mode="r"))  # R^T R = H
    B = solve_triangular(R, A.T, trans=1, check_finite=False).T  # B B^T = A H^-1 A^T
    e = y - B @ (B.T @ y)
    value = float(y @ e)  # e^T e + u^T u
    value += 2.0 * float(np.sum(np.log(np.abs(np.diagonal(R)))))
    value -= 2.0 * float(np.sum(np.log(np.diagonal(W, axis1=1, axis2=2))))
    halves = noise.halves(W, at.J)
    cube, rest = B.reshape(n, k, m), e.reshape(n, k, 1)
    square, HB, M, score = [], [], [], []
    for i in estimated:
        H, Ht = halves[i], np.swapaxes(halves[i], 1, 2)
        square.append(H @ Ht)
        HB.append((H @ (Ht @ cube)).reshape(-1, m))
        M.append(B.T @ HB[-1])
        score.append(np.sum((Ht @ rest) ** 2) - np.sum(H**2) + np.trace(M[-1]))
    F = np.empty((len(estimated), len(estimated)))
    for i in range(len(estimated)):
        for j in range(i + 1):
            F[i, j] = np.sum(square[i] * square[j]) - 2.0 * np.sum(HB[i] * HB[j]) + np.sum(M[i] * M[j].T)
            F[j, i] = F[i, j]
        F[i, i] += _BELIEVED * np.sum(square[i] ** 2)
    if belief is None:
        return _Likelihood(value, np.array(score), F)
    theta = noise.theta[estimated]
    ratio = belief[estimated] / theta  # of WEIGHT numbers with this mean square
    value += WEIGHT * float(np.sum(np.log(theta) + ratio))
    return _Likelihood(
        value, np.array(score) + WEIGHT * (ratio - 1.0) / theta, F + np.diag(WEIGHT / theta**2)
    )


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
