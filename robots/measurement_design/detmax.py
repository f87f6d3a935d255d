"""Exact designs from relaxed ones: rounding, expansion and exchange as in DetMax.

Probst (2024), section 4.2. What an exchange of two measurements brings is predicted to the second order for
all pairs of a chosen one and one of a pool, the candidates that the certificate values most; the pairs that
promise most are compared exactly. The first order alone does not do: near the optimum all of the pool have
the same gain, and how a pair bends the criterion decides. Where no exchange helps and the bound is still
away, some measurements are replaced at random and the exchanges begin once more.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robots.measurement_design.candidates import Candidates
from robots.measurement_design.criteria import Criterion, SecondOrder, SmallestEigenvalue
from robots.measurement_design.relaxed_design import RelaxedDesign

_POOL, _POOL_PER_MEASUREMENT = 1000, 2  # candidates by their gain on the certificate
_NEWCOMERS = 200  # by their gain at the design itself: they see what those of the certificate neglect
_EXPANSIONS = 8  # with the same newcomers
_COMPARED = 24  # exchanges that are compared exactly
_LEAVERS = 150  # with the least to lose, where more are chosen
_SHARPNESS = (10.0, 30.0, 100.0)  # of the soft smallest eigenvalue, from rough to fine
_MOST_EXCHANGES = 200
_WORTHWHILE = 1e-6  # relative gain of an exchange
_NEAR = 0.995  # of the bound: what is better is good enough
_FRESH_STARTS = 25
_REPLACED = 0.15  # largest share of the measurements that is replaced at random
_TRACE = 1e-6  # of information everywhere lets the first expansions see where something is missing


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
        rng: says which measurements are replaced where no exchange helps.
        progress: is called now and then with the share that is done.

    Raises:
        ValueError: if too few candidates are admissible.
    """
    report = progress or (lambda share: None)
    pool = _Pool(candidates, criterion, relaxed, count)
    best = pool.exchanged(pool.expanded(_rounded(relaxed, count), count))
    for number in range(_FRESH_STARTS):
        if best.value >= _NEAR * count * relaxed.bound:
            break
        report((number + 1) / (_FRESH_STARTS + 1))
        pool.take_in(best.numbers, number)
        best = max(best, pool.exchanged(pool.shaken(best, rng)), key=lambda each: each.value)
    return best


def _rounded(relaxed: RelaxedDesign, count: int) -> np.ndarray:
    """The candidates with the largest shares, as many as have half a measurement or more."""
    order = np.argsort(-relaxed.shares)
    return relaxed.numbers[order][: min(count, int(np.sum(relaxed.shares * count >= 0.5)))]


class _Pool:
    """The candidates that come into question for the whole design."""

    def __init__(
        self, candidates: Candidates, criterion: Criterion, relaxed: RelaxedDesign, count: int
    ) -> None:
        self._candidates, self._criterion = candidates, criterion
        size = _POOL + _POOL_PER_MEASUREMENT * count
        valued, _ = candidates.best(relaxed.certificate, size, fewest=count)
        self._valued = np.union1d(valued, relaxed.numbers)
        self._goals: list[Criterion] = [criterion]
        if isinstance(criterion, SmallestEigenvalue):
            self._goals = [SmallestEigenvalue(sharpness) for sharpness in _SHARPNESS]
        self._trace = _TRACE * np.eye(candidates.grid.parameters.rank)
        self._fill(self._valued)

    def _fill(self, numbers: np.ndarray) -> None:
        self.numbers, self.information = numbers, self._inform(numbers)

    def _inform(self, numbers: np.ndarray) -> np.ndarray:
        grid = self._candidates.grid
        return grid.information(grid.configurations(numbers))

    def take_in(self, chosen: np.ndarray, turn: int) -> None:
        """Adds the candidates that a design, by its numbers, values most, by another gradient every turn."""
        M = self._inform(chosen).sum(axis=0) + self._trace
        root = self._goals[turn % len(self._goals)].gradient_root(M)
        others, _ = self._candidates.best(root, _NEWCOMERS, chosen, fewest=0)
        self._fill(np.unique(np.concatenate([self._valued, chosen, others])))

    def expanded(self, numbers: np.ndarray, count: int) -> np.ndarray:
        """Indices of so many candidates: those of ``numbers``, then the best of the pool one by one."""
        goal = self._goals[len(self._goals) // 2]
        while len(numbers) < count:
            self.take_in(numbers, len(self._goals) // 2)
            chosen = list(np.searchsorted(self.numbers, numbers))
            M = self.information[chosen].sum(axis=0) + self._trace
            for _ in range(min(_EXPANSIONS, count - len(numbers))):
                # To the first order: where a direction is missing, one measurement is no small step.
                gains = goal.second_order(M, self.information).slopes.copy()
                gains[chosen] = -np.inf
                likely = _largest(gains)
                best = likely[np.argmax(self._criterion.value(M + self.information[likely]))]
                chosen.append(best)
                M = M + self.information[best]
            numbers = self.numbers[chosen]
        return np.searchsorted(self.numbers, numbers)

    def shaken(self, design: WholeDesign, rng: np.random.Generator) -> np.ndarray:
        """Indices of a design with some of its measurements replaced at random."""
        chosen = np.searchsorted(self.numbers, design.numbers)
        count = int(rng.integers(1, max(2, int(_REPLACED * len(chosen))), endpoint=True))
        others = np.setdiff1d(np.arange(len(self.numbers)), chosen)
        count = min(count, len(others))
        chosen[rng.choice(len(chosen), count, replace=False)] = rng.choice(others, count, replace=False)
        return chosen

    def exchanged(self, chosen: np.ndarray) -> WholeDesign:
        """Exchanges measurements until that does not help any more; gives the design from its indices."""
        M = self.information[chosen].sum(axis=0)
        value = float(self._criterion.value(M))
        for goal in self._goals:
            for _ in range(_MOST_EXCHANGES):
                order = goal.second_order(M + self._trace, self.information)
                out, new = _likely_exchanges(order, chosen)
                tried = M - self.information[chosen[out]] + self.information[new]
                values = self._criterion.value(tried)
                best = int(np.argmax(values))
                if not values[best] > value * (1.0 + _WORTHWHILE):
                    break
                M, value = tried[best], float(values[best])
                chosen[out[best]] = new[best]
        return WholeDesign(
            self.numbers[chosen], float(self._criterion.value(self.information[chosen].sum(axis=0)))
        )


def _likely_exchanges(order: SecondOrder, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places in ``chosen``, and the candidates that are to stand there, by what is predicted of them."""
    others = np.setdiff1d(np.arange(len(order.slopes)), chosen)
    places = np.argsort(order.slopes[chosen])[:_LEAVERS]
    leavers = chosen[places]
    squares = np.sum(order.bends**2, axis=1)
    bends = squares[leavers][:, None] + squares[others] - 2.0 * order.bends[leavers] @ order.bends[others].T
    gains = _predicted(order.slopes[others] - order.slopes[leavers][:, None], bends, order.lift)
    out, new = np.unravel_index(_largest(gains.ravel()), gains.shape)
    return places[out], others[new]


def _predicted(slopes: np.ndarray, bends: np.ndarray, lift: float) -> np.ndarray:
    return slopes + 0.5 * (lift * slopes**2 - bends)


def _largest(gains: np.ndarray) -> np.ndarray:
    """The indices of the largest ones."""
    few = min(_COMPARED, len(gains))
    return np.argpartition(-gains, few - 1)[:few]
