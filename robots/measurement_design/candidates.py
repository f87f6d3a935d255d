"""The admissible candidates of a grid."""

from collections.abc import Callable, Sequence

import numpy as np

from robots.measurement_design.candidate_grid import CandidateGrid

# Joint positions in rad (n, 6) -> which of them are admissible, (n,) bool.
Admissible = Callable[[np.ndarray], np.ndarray]

_UNKNOWN, _ALLOWED, _REFUSED = 0, 1, 2
_FEW = (
    60_000  # cases that differ: so many are all checked before anything else, which takes about two seconds
)
_MOST_TRIED = 200  # times as many random candidates as are wanted
_POOL = 20  # times as many candidates as are wanted are sorted at once
_SAMPLED, _LEAST_SAMPLED = 101, 8  # every so many candidates tell how large the largest gains are


class Candidates:
    """A grid with its constraints.

    Candidates that differ in joints alone on which the constraints do not depend are one case. If there are
    few cases all of them are checked at once, else only those of the candidates with the largest gains.
    """

    def __init__(
        self, grid: CandidateGrid, admissible: Admissible | None = None, indifferent: Sequence[int] = ()
    ) -> None:
        """Takes a grid.

        Args:
            grid: the candidates.
            admissible: which configurations are allowed; None for all of them.
            indifferent: indices of joints on which that does not depend anywhere on the grid.
        """
        self.grid = grid
        self._admissible = admissible
        self._state = np.full(grid.shape, _UNKNOWN, dtype=np.uint8)
        self._on = [i for i in range(len(grid.shape)) if i not in indifferent]  # joints that make the cases
        shape = tuple(grid.shape[i] for i in self._on)
        if admissible is not None and np.prod(shape) <= _FEW:
            cases = np.zeros((len(grid.shape), int(np.prod(shape))), dtype=int)
            cases[self._on] = np.unravel_index(np.arange(cases.shape[1]), shape)
            self._check(np.asarray(np.ravel_multi_index(tuple(cases), grid.shape)))

    @property
    def num_refused(self) -> int:
        """How many candidates have been found to be inadmissible so far."""
        return int(np.count_nonzero(self._state == _REFUSED))

    def best(
        self, root: np.ndarray, count: int, without: np.ndarray | None = None, fewest: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The admissible candidates with the largest tr(W Theta^T Theta), W = root root^T.

        Args:
            root: shape (rank, any).
            count: how many are wanted.
            without: numbers of candidates that do not count.
            fewest: how many suffice where no more are admissible; None for ``count``.

        Returns:
            Their numbers and gains, the largest gain first. No admissible candidate of the whole grid has a
            gain above the first one's, except those in ``without``.

        Raises:
            ValueError: if fewer candidates are admissible than must be.
        """
        fewest = count if fewest is None else fewest
        gains = self.grid.screen(root)
        if without is not None:
            gains[without] = -np.inf
        # The largest of millions: those above a limit that a sample says, and a lower one if it was too high.
        is_open = self._state.reshape(-1) != _REFUSED
        sample = np.sort(gains[::_SAMPLED][is_open[::_SAMPLED]])[::-1]
        pool = _POOL * count
        while True:
            last = pool // _SAMPLED + _LEAST_SAMPLED
            limit = sample[last] if last < len(sample) else -np.inf
            numbers = np.flatnonzero((gains > limit) & is_open)
            found = self._first_allowed(numbers[np.argsort(-gains[numbers])], count)
            if len(found) == count:
                return found, gains[found]
            if limit == -np.inf:
                if len(found) >= fewest:
                    return found, gains[found]
                raise ValueError(f"fewer than {fewest} candidate configurations are admissible")
            pool *= 8

    def _first_allowed(self, numbers: np.ndarray, count: int) -> np.ndarray:
        """The first ``count`` admissible ones of some candidates, or as many as there are."""
        found, block_size = np.empty(0, dtype=int), count
        start = 0
        while start < len(numbers) and len(found) < count:
            block = numbers[start : start + block_size]
            found = np.concatenate([found, block[self._check(block)]])
            start, block_size = start + block_size, 2 * block_size
        return found[:count]

    def sample(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Numbers of random admissible candidates, all different, shape (count,).

        Raises:
            ValueError: if too few candidates are admissible.
        """
        order = rng.choice(len(self.grid), min(len(self.grid), _MOST_TRIED * count), replace=False)
        found = np.empty(0, dtype=int)
        for block in np.array_split(order, _MOST_TRIED):
            found = np.concatenate([found, block[self._check(block)]])
            if len(found) >= count:
                return found[:count]
        raise ValueError(
            f"only {len(found)} of {len(order)} random candidate configurations are admissible; "
            "widen the ranges or what is allowed"
        )

    def _check(self, numbers: np.ndarray) -> np.ndarray:
        """Which candidates are admissible, (n,) bool; what is not known yet is found out."""
        if self._admissible is None or not len(numbers):
            return np.ones(len(numbers), dtype=bool)
        state = self._state.reshape(-1)
        unknown = numbers[state[numbers] == _UNKNOWN]
        if len(unknown):
            indices = np.array(np.unravel_index(unknown, self.grid.shape))
            cases = np.ravel_multi_index(
                tuple(indices[self._on]), tuple(self._state.shape[i] for i in self._on)
            )
            _, first = np.unique(cases, return_index=True)
            allowed = self._admissible(self.grid.configurations(unknown[first]))
            for is_allowed, found in ((allowed, _ALLOWED), (~allowed, _REFUSED)):
                case: list[slice | np.ndarray] = [slice(None)] * len(indices)
                for joint in self._on:
                    case[joint] = indices[joint, first[is_allowed]]
                self._state[tuple(case)] = found
        return state[numbers] == _ALLOWED
