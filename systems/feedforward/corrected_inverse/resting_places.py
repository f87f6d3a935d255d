"""Where in their play gears without load may rest, and a cost that is to be small wherever they do."""

from dataclasses import dataclass

import numpy as np

_POWER = 3.0  # of the mean over the cases: near the worst of them, and still smooth
_LEAST = 1e-3  # share of the largest reference, so that a case that is right already does not count alone


@dataclass(frozen=True)
class Resting:
    """Where unloaded gears are taken to rest, and how wide their play is taken to be."""

    place: float  # -1 to 1, from one end of the play to the other
    play: float  # share of the believed one


MIDDLE = Resting(0.0, 1.0)
# How wide the play is decides when the link swings across it, and an identification finds it to a fifth.
ANYWHERE = (Resting(-1.0, 0.8), Resting(-1.0, 1.2), MIDDLE, Resting(1.0, 0.8), Resting(1.0, 1.2))


@dataclass(frozen=True)
class WorstOf:
    """A smooth worst case of sums of squares, each as a share of what it was before.

    M = (mean of (c / r)^p)^(1/p) with the references r divided by their mean: a case in which little was left
    may not become worse for the sake of the others. A single case is its own M.
    """

    reference: np.ndarray  # (cases,)

    @classmethod
    def than(cls, before: np.ndarray) -> "WorstOf":
        """Against the sums of squares before, (cases,)."""
        reference = np.maximum(before, max(_LEAST * before.max(), np.finfo(float).tiny))
        return cls(reference / reference.mean())

    def cost(self, squares: np.ndarray) -> float:
        """M of the sums of squares, (cases,)."""
        return float(np.mean((squares / self.reference) ** _POWER) ** (1.0 / _POWER))

    def slopes(self, squares: np.ndarray) -> np.ndarray:
        """d(M) / d(squares), (cases,)."""
        mean = max(self.cost(squares), np.finfo(float).tiny)
        return (squares / self.reference / mean) ** (_POWER - 1.0) / (len(squares) * self.reference)
