"""Exact designs from relaxed ones: rounding, expansion and exchange as in DetMax.

Probst (2024), section 4.2. The best partners of an exchange are found by their first-order gain among all
candidates of the grid; what is left of them is compared exactly. Where no exchange helps and the bound is
still away, some measurements are taken out at random and chosen once more.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robots.measurement_design.candidates import Candidates
from robots.measurement_design.criteria import Criterion, SmallestEigenvalue
from robots.measurement_design.relaxed_design import RelaxedDesign

_NEWCOMERS, _LEAVERS = 40, 8  # whose pairs are compared exactly
_SHARPNESS = (30.0, 100.0, 10.0, 300.0)  # with which a gradient for B3 is tried when the last one led nowhere
_MOST_EXCHANGES = 200
_WORTHWHILE = 1e-6  # relative gain of an exchange
_NEAR = 0.99  # of the bound: what is better is good enough
_FRESH_STARTS = 5
_TAKEN_OUT = 0.2  # largest share of the measurements that is chosen once more


@dataclass(frozen=True)
class WholeDesign:
    """Candidates to be measured once each, and the criterion they reach together."""

    numbers: np.ndarray  # (count,)
    value: float


def whole_design(
    candidates: Candidates,
    criterion: Criterion,
    relaxed: RelaxedDesign,
    count: int,
    rng: np.random.Generator,
    progress: Callable[[float], None] | None = None,
) -> WholeDesign:
    """Chooses ``count`` different candidates.

    Args:
        candidates: where the robot may be measured.
        criterion: what is maximised.
        relaxed: the solution to start from.
        count: how many measurements; at least so many that all parameters can be seen.
        rng: says which measurements are taken out where no exchange helps.
        progress: is called now and then with the share that is done.

    Raises:
        ValueError: if too few candidates are admissible.
    """
    report = progress or (lambda share: None)
    best = _Chosen(candidates, criterion, _rounded(relaxed, count))
    best.complete(count, lambda share: report(0.5 * share))
    for number in range(_FRESH_STARTS):
        if best.value >= _NEAR * count * relaxed.bound:
            break
        out = rng.choice(
            count, rng.integers(1, max(2, int(_TAKEN_OUT * count)), endpoint=True), replace=False
        )
        other = _Chosen(candidates, criterion, np.delete(best.numbers, out))
        other.complete(count)
        best = max(best, other, key=lambda each: each.value)
        report(0.5 + 0.5 * (number + 1) / _FRESH_STARTS)
    return WholeDesign(best.numbers, best.value)


def _rounded(relaxed: RelaxedDesign, count: int) -> np.ndarray:
    """The candidates with the largest shares, as many as have half a measurement or more."""
    order = np.argsort(-relaxed.shares)
    return relaxed.numbers[order][: min(count, int(np.sum(relaxed.shares * count >= 0.5)))]


class _Chosen:
    """The candidates chosen so far."""

    def __init__(self, candidates: Candidates, criterion: Criterion, numbers: np.ndarray) -> None:
        self._candidates, self._criterion = candidates, criterion
        self.numbers, self._each = numbers, self._inform(numbers)
        rank = candidates.grid.parameters.rank
        # A trace of information everywhere lets the first expansions see where something is missing.
        self._M = self._each.sum(axis=0) + 1e-6 * np.eye(rank)
        self._gradients: list[Criterion] = [criterion]
        if isinstance(criterion, SmallestEigenvalue):
            self._gradients = [SmallestEigenvalue(sharpness) for sharpness in _SHARPNESS]

    def _inform(self, numbers: np.ndarray) -> np.ndarray:
        return self._candidates.grid.information(self._candidates.grid.configurations(numbers))

    @property
    def value(self) -> float:
        """The criterion of what is chosen."""
        return float(self._criterion.value(self._each.sum(axis=0)))

    def complete(self, count: int, progress: Callable[[float], None] | None = None) -> None:
        """Adds candidates until there are ``count``, and exchanges some until that does not help any more."""
        while len(self.numbers) < count:
            self.expand()
            if progress:
                progress(0.5 * len(self.numbers) / count)
        for number in range(_MOST_EXCHANGES):
            if not self.exchange():
                break
            if progress:
                progress(0.5 + 0.5 * number / _MOST_EXCHANGES)

    def expand(self) -> None:
        """Adds the best candidate."""
        newcomers, information = self._newcomers(self._gradients[0])
        best = int(np.argmax(self._criterion.value(self._M + information)))
        self.numbers = np.append(self.numbers, newcomers[best])
        self._each = np.concatenate([self._each, information[best : best + 1]])
        self._M = self._M + information[best]

    def exchange(self) -> bool:
        """Replaces one candidate by a better one; False if no pair that was tried is better."""
        now = float(self._criterion.value(self._M))
        for gradient in self._gradients:
            root = gradient.gradient_root(self._M)
            leavers = np.argsort(np.einsum("nir,ir->n", self._each @ root, root))[:_LEAVERS]
            newcomers, information = self._newcomers(gradient)
            pairs = (self._M - self._each[leavers])[:, None] + information
            values = self._criterion.value(pairs)
            out, new = np.unravel_index(np.argmax(values), values.shape)
            if values[out, new] > now * (1.0 + _WORTHWHILE):
                self._M = pairs[out, new]
                self.numbers[leavers[out]], self._each[leavers[out]] = newcomers[new], information[new]
                return True
        return False

    def _newcomers(self, gradient: Criterion) -> tuple[np.ndarray, np.ndarray]:
        root = gradient.gradient_root(self._M)
        numbers, _ = self._candidates.best(root, _NEWCOMERS, without=self.numbers)
        return numbers, self._inform(numbers)
