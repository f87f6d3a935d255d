"""The optimal relaxed design, which bounds how good any exact design can be.

The relaxed problem gives each candidate a share of the measurements and is convex. Its solution is found on
a small set of candidates that grows by those with the largest gains on the whole grid. Every step proves an
upper bound, see `robots.measurement_design.criteria`, and the best design so far is a lower one; they meet.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from robots.measurement_design.candidates import Candidates
from robots.measurement_design.criteria import Criterion, SmallestEigenvalue

_START, _ADDED = 400, 50  # candidates at the beginning, and in each round
_ROUNDS = 40
_GAP = 1e-4  # between the bounds of B3, relative; the others come closer to their bounds more slowly
_SLOW_GAP = 1e-3
_SHARPNESS = (60.0, 200.0, 600.0, 2000.0)  # of the soft smallest eigenvalue, from rough to fine
_MULTIPLICATIVE_STEPS = 60
_RANK = 3  # least one of the certificate for B3
_ALIKE = 1.1  # times the smallest eigenvalue: so near, others will be as small in the best design
_IDLE = 1e-5  # a share below this is dropped
_LARGEST_CUT = 0.1  # of a share in one multiplicative step
_BLIND = 0.5  # share of the criterion's value below which what is kept has lost a direction
_HOPELESS = 0.97  # times the gain of a candidate that deserves its share


@dataclass(frozen=True)
class RelaxedDesign:
    """Shares of the measurements, with a lower and an upper bound for one measurement in all."""

    numbers: np.ndarray  # (n,) of the candidates with a share
    shares: np.ndarray  # (n,), positive, their sum is one
    value: float  # the criterion of the shares
    bound: float  # no design has more, times its number of measurements
    certificate: np.ndarray  # (rank, r): bound is the largest gain of this root on the grid


def relaxed_design(
    candidates: Candidates,
    criterion: Criterion,
    rng: np.random.Generator,
    progress: Callable[[float], None] | None = None,
) -> RelaxedDesign:
    """Solves the relaxed problem until the bounds are within one in ten thousand, or for forty rounds.

    Args:
        candidates: where the robot may be measured.
        criterion: what is maximised.
        rng: chooses the candidates to begin with.
        progress: is called now and then with the share that is done.

    Raises:
        ValueError: if too few candidates are admissible.
    """
    gap = _GAP if isinstance(criterion, SmallestEigenvalue) else _SLOW_GAP
    work = _WorkingSet(candidates, criterion, candidates.sample(rng, _START))
    for number in range(_ROUNDS):
        root = work.improve()
        numbers, gains = candidates.best(root, _ADDED)
        work.note_bound(float(gains[0]), root)
        if progress:
            progress((number + 1) / _ROUNDS)
        if work.bound <= work.best_value * (1.0 + gap):
            break
        work.replace_idle(numbers, root)
    kept = work.best_shares > _IDLE
    shares = work.best_shares[kept] / work.best_shares[kept].sum()
    return RelaxedDesign(work.best_numbers[kept], shares, work.best_value, work.bound, work.certificate)


class _WorkingSet:
    """The candidates that the shares are divided among, and the best that has been found."""

    def __init__(self, candidates: Candidates, criterion: Criterion, numbers: np.ndarray) -> None:
        self._candidates, self._criterion = candidates, criterion
        self._numbers, self._information = numbers, self._inform(numbers)
        self._shares = np.full(len(numbers), 1.0 / len(numbers))
        self._direction: np.ndarray | None = None  # of the certificate for B3
        self._trust = 0.05
        self._rounds = 0
        self.best_numbers, self.best_shares, self.best_value = numbers, self._shares, 0.0
        self.bound, self.certificate = np.inf, np.empty((0, 0))

    def _inform(self, numbers: np.ndarray) -> np.ndarray:
        return self._candidates.grid.information(self._candidates.grid.configurations(numbers))

    def _mean(self, shares: np.ndarray) -> np.ndarray:
        rank = self._information.shape[-1]
        return (shares @ self._information.reshape(len(shares), -1)).reshape(rank, rank)

    def note_bound(self, bound: float, root: np.ndarray) -> None:
        """Remembers an upper bound if it is the lowest so far."""
        if bound < self.bound:
            self.bound, self.certificate = bound, root

    def improve(self) -> np.ndarray:
        """Better shares on the set; returns the root of a gradient there, a certificate to be."""
        self._rounds += 1
        is_rough = self._rounds <= 8 or not isinstance(self._criterion, SmallestEigenvalue)
        root = self._multiplicative() if is_rough else self._quadratic()
        value = float(self._criterion.value(self._mean(self._shares)))
        if value > self.best_value:
            self.best_numbers, self.best_shares, self.best_value = self._numbers, self._shares, value
        return root

    def replace_idle(self, numbers: np.ndarray, root: np.ndarray) -> None:
        """Drops candidates that get nothing or are on the way to it, and takes in others."""
        gains = self._gains(root)
        if self._direction is None:
            kept = (self._shares > _IDLE) & (gains > _HOPELESS * (self._shares @ gains))
            if not self._sees_everything(kept):
                kept = self._shares > _IDLE
        else:
            kept = (self._shares > _IDLE) | (gains > _HOPELESS * gains.max())
        new = np.setdiff1d(numbers, self._numbers[kept])
        self._numbers = np.concatenate([self._numbers[kept], new])
        self._information = np.concatenate([self._information[kept], self._inform(new)])
        shares = np.concatenate([self._shares[kept], np.full(len(new), 0.05 / max(1, len(new)))])
        self._shares = shares / shares.sum()

    def _sees_everything(self, kept: np.ndarray) -> bool:
        """Whether a part of the set keeps much of the criterion's value: a gradient sees one direction."""
        whole, part = self._mean(self._shares), self._mean(np.where(kept, self._shares, 0.0))
        return float(self._criterion.value(part)) > _BLIND * float(self._criterion.value(whole))

    def _gains(self, root: np.ndarray) -> np.ndarray:
        return np.einsum("nir,ir->n", self._information @ root, root)

    def _multiplicative(self) -> np.ndarray:
        """Shares times a power of their gains, again and again: safe, quick at first, then slow."""
        is_b3 = isinstance(self._criterion, SmallestEigenvalue)
        roots = (
            [SmallestEigenvalue(sharpness) for sharpness in _SHARPNESS] if is_b3 else [self._criterion] * 4
        )
        shares = self._shares
        for each, sharpness in zip(roots, _SHARPNESS, strict=True):
            power = min(1.0, 130.0 / sharpness) if is_b3 else 1.0
            for _ in range(_MULTIPLICATIVE_STEPS):
                gains = self._gains(each.gradient_root(self._mean(shares)))
                # A gain sees one direction only: a share that fell to zero here could never come back.
                shares = shares * np.power(np.maximum(gains / (shares @ gains), _LARGEST_CUT), power)
                shares = shares / shares.sum()
        self._shares = shares
        return roots[-1].gradient_root(self._mean(shares))

    def _quadratic(self) -> np.ndarray:
        """One step of sequential quadratic programming for the certificate of B3; its duals are the shares.

        The certificate is a root B with |B| = 1 that minimises the largest gain |Theta B|^2. The Lagrangian
        has the Hessian 2 (M - smallest eigenvalue), which is positive where it must be.
        """
        M = self._mean(self._shares)
        eigenvalues, vectors = np.linalg.eigh(M)
        if self._direction is None:
            rank = max(_RANK, int(np.sum(eigenvalues < _ALIKE * eigenvalues[0])))
            shares = np.full(rank, 0.02 / (rank - 1))
            shares[0] = 1.0 - shares[1:].sum()
            self._direction = vectors[:, :rank] * np.sqrt(shares)
        B = self._direction
        forward = self._information @ B
        gains = np.einsum("nir,ir->n", forward, B)
        H = 2.0 * np.kron(M - eigenvalues[0] * np.eye(len(M)), np.eye(B.shape[1])) + 1e-3 * np.eye(B.size)
        step, shares = _minimax_step(gains, 2.0 * forward.reshape(len(gains), -1), H, B.ravel(), self._trust)
        if shares is None:
            self._trust *= 0.5
            return B
        self._shares = shares
        moved = B + step.reshape(B.shape)
        moved /= np.linalg.norm(moved)
        if self._gains(moved).max() <= gains.max() * (1.0 + 1e-12):
            self._direction = moved
        else:
            self._trust *= 0.5
        return self._direction


def _minimax_step(
    values: np.ndarray, slopes: np.ndarray, H: np.ndarray, normal: np.ndarray, trust: float
) -> tuple[np.ndarray, np.ndarray | None]:
    """The step d that minimises max(values + slopes d) + d^T H d / 2, across ``normal``, within ``trust``.

    Returns:
        The step and the multipliers of the values, which sum to one; None for these if the solver fails.
    """
    program = MathematicalProgram()
    d = program.NewContinuousVariables(len(normal), "d")
    t = program.NewContinuousVariables(1, "t")
    program.AddQuadraticCost(H, np.zeros(len(normal)), d, is_convex=True)
    program.AddLinearCost(t[0])
    below = program.AddLinearConstraint(
        np.hstack([slopes, -np.ones((len(values), 1))]),
        np.full(len(values), -np.inf),
        -values,
        np.concatenate([d, t]),
    )
    program.AddLinearEqualityConstraint(normal[None], np.zeros(1), d)
    program.AddBoundingBoxConstraint(-trust, trust, d)
    result = ClarabelSolver().Solve(program)
    if not result.is_success():
        return np.zeros_like(normal), None
    multipliers = np.maximum(-result.GetDualSolution(below), 0.0)
    return result.GetSolution(d), multipliers / multipliers.sum()
