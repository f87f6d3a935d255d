"""The admissible candidates of a grid; each is checked only when it is considered."""

from collections.abc import Callable

import numpy as np

from robots.measurement_design.candidate_grid import CandidateGrid

# Joint positions in rad (n, 6) -> which of them are admissible, (n,) bool.
Admissible = Callable[[np.ndarray], np.ndarray]

_UNKNOWN, _ALLOWED, _REFUSED = 0, 1, 2
_POOL = 20  # times as many candidates as are wanted are sorted at once


class Candidates:
    """A grid with its constraints. Only the candidates with the largest gains are ever checked."""

    def __init__(self, grid: CandidateGrid, admissible: Admissible | None = None) -> None:
        """Takes a grid.

        Args:
            grid: the candidates.
            admissible: which configurations are allowed; None for all of them.
        """
        self.grid = grid
        self._admissible = admissible
        self._state = np.zeros(len(grid), dtype=np.uint8)
        self._refused: list[np.ndarray] = [np.empty(0, dtype=int)]

    @property
    def num_refused(self) -> int:
        """How many candidates have been found to be inadmissible so far."""
        return sum(map(len, self._refused))

    def best(
        self, root: np.ndarray, count: int, without: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The admissible candidates with the largest tr(W Theta^T Theta), W = root root^T.

        Args:
            root: shape (rank, any).
            count: how many are wanted.
            without: numbers of candidates that do not count.

        Returns:
            Their numbers and gains, the largest gain first. No admissible candidate of the whole grid has a
            gain above the first one's, except those in ``without``.

        Raises:
            ValueError: if fewer than ``count`` candidates are admissible.
        """
        gains = self.grid.screen(root)
        if without is not None:
            gains[without] = -np.inf
        gains[np.concatenate(self._refused)] = -np.inf
        pool = _POOL * count
        while True:
            pool = min(pool, len(gains))
            numbers = np.argpartition(gains, -pool)[-pool:]
            found = self._first_allowed(numbers[np.argsort(-gains[numbers])], count)
            found = found[np.isfinite(gains[found])]
            if len(found) == count:
                return found, gains[found]
            if pool == len(gains):
                raise ValueError(f"fewer than {count} candidate configurations are admissible")
            pool *= 8

    def _first_allowed(self, numbers: np.ndarray, count: int) -> np.ndarray:
        """The first ``count`` admissible ones of some candidates, or as many as there are."""
        found = np.empty(0, dtype=int)
        for start in range(0, len(numbers), count):
            block = numbers[start : start + count]
            self._check(block[self._state[block] == _UNKNOWN])
            found = np.concatenate([found, block[self._state[block] != _REFUSED]])
            if len(found) >= count:
                break
        return found[:count]

    def sample(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Numbers of random admissible candidates, all different, shape (count,).

        Raises:
            ValueError: if too few candidates are admissible.
        """
        order = rng.choice(len(self.grid), min(len(self.grid), 20 * count), replace=False)
        found = np.empty(0, dtype=int)
        for block in np.array_split(order, 20):
            self._check(block)
            found = np.concatenate([found, block[self._state[block] != _REFUSED]])
            if len(found) >= count:
                return found[:count]
        raise ValueError(
            f"only {len(found)} of {len(order)} random candidate configurations are admissible; "
            "widen the ranges or what is allowed"
        )

    def _check(self, numbers: np.ndarray) -> None:
        if self._admissible is None or not len(numbers):
            return
        allowed = self._admissible(self.grid.configurations(numbers))
        self._state[numbers] = np.where(allowed, _ALLOWED, _REFUSED)
        self._refused.append(numbers[~allowed])
