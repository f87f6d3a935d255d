"""Places of the markers on a body that determine its pose best, Probst (2024), section 8.3.

Markers are moved one at a time by random steps that become shorter; a step is kept if it makes the score
smaller. Markers keep within the box of the body and apart from each other, and no two distances become alike,
for by these the tracker tells them from one another.
"""

from collections.abc import Callable

import numpy as np

_FIRST, _LAST = 0.06, 0.003  # m, length of the first and of the last steps


def distinct(p_E: np.ndarray) -> float:
    """The smallest difference between two distances of markers (m, 3) in m."""
    return float(np.diff(np.sort(_distances(p_E))).min())


def spacing(p_E: np.ndarray) -> float:
    """The smallest distance between two markers (m, 3) in m."""
    return float(_distances(p_E).min())


def optimised_markers(
    p_E: np.ndarray,
    score: Callable[[np.ndarray], float],
    steps: int,
    seed: int,
    least: float,
    alike: float,
    progress: Callable[[float], None] | None = None,
) -> np.ndarray:
    """Markers in the box of a body with a smaller score.

    Args:
        p_E: markers to begin with, (m, 3) in m, at least four.
        score: of such markers; smaller is better, infinite for what cannot be.
        steps: how many are tried.
        seed: of the random steps.
        least: distance of two markers in m.
        alike: by which two distances must differ at least in m.
        progress: is called with the share that is done.

    Returns:
        The best markers that were found, (m, 3) in m; those of the beginning if none was better.

    Raises:
        ValueError: if the markers to begin with are nearer to each other or more alike than that, and no step
            of one of them mended it.
    """
    rng = np.random.default_rng(seed)
    low, high = p_E.min(axis=0), p_E.max(axis=0)
    best, lowest = p_E.copy(), np.inf
    if spacing(p_E) >= least and distinct(p_E) >= alike:
        lowest = score(p_E)
    for step in range(steps):
        length = _FIRST * (_LAST / _FIRST) ** (step / max(1, steps - 1))
        tried = best.copy()
        k = rng.integers(len(best))
        tried[k] = np.clip(tried[k] + length * rng.standard_normal(3), low, high)
        if spacing(tried) >= least and distinct(tried) >= alike:
            found = score(tried)
            if found < lowest:
                best, lowest = tried, found
        if progress:
            progress((step + 1) / steps)
    if lowest == np.inf:
        raise ValueError(
            f"body: its markers are {1e3 * spacing(p_E):.1f} mm apart and their distances differ by "
            f"{1e3 * distinct(p_E):.1f} mm at least; in {steps} steps none was found where these are "
            f"{1e3 * least:g} and {1e3 * alike:g} mm: allow less, or try more steps"
        )
    return best


def _distances(p_E: np.ndarray) -> np.ndarray:
    i, j = np.triu_indices(len(p_E), 1)
    return np.linalg.norm(p_E[i] - p_E[j], axis=1)
