"""The visiting order of configurations that keeps the motion between them short."""

import numpy as np

# The first three joints carry the arm and are slow to settle, Probst (2024) section 4.2.
JOINT_WEIGHTS = np.array([3.0, 3.0, 3.0, 1.0, 1.0, 1.0])


def visiting_order(q: np.ndarray, start: np.ndarray, weights: np.ndarray = JOINT_WEIGHTS) -> np.ndarray:
    """A short way through configurations: each time to the nearest, then detours are cut out (2-opt).

    The distance of two configurations is the length of the weighted difference of their joint positions.

    Args:
        q: configurations in rad, shape (n, 6).
        start: where the robot stands before the first one, shape (6,).
        weights: of the joints, shape (6,).

    Returns:
        The order of visits, shape (n,).
    """
    points = np.vstack([start, q]) * weights
    distance = np.linalg.norm(points[:, None] - points, axis=-1)
    order, left = [0], set(range(1, len(points)))
    while left:
        nearest = min(left, key=lambda k: (distance[order[-1], k], k))
        order.append(nearest)
        left.remove(nearest)
    return _without_detours(np.array(order), distance)[1:] - 1


def way_length(q: np.ndarray, start: np.ndarray, weights: np.ndarray = JOINT_WEIGHTS) -> float:
    """The weighted length in rad of the way from the start through configurations in their order."""
    points = np.vstack([start, q]) * weights
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _without_detours(order: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Reverses stretches of an open way, the best one first, as long as that makes it shorter."""
    n = len(order)
    later = np.triu(np.ones((n, n), dtype=bool), 1)
    while True:
        d = distance[np.ix_(order, order)]
        # The way ends free: nothing follows the last place.
        following = np.hstack([d[:, 1:], np.zeros((n, 1))])
        step = np.append(np.diagonal(d, 1), 0.0)
        # Reversing the places i + 1 to j puts j after i, and the one after j after i + 1.
        change = np.zeros((n, n))
        change[:-1] = d[:-1] + following[1:] - step[:-1, None] - step
        change[:, -1] = np.append(d[:-1, -1] - step[:-1], 0.0)
        change[~later] = 0.0
        i, j = np.unravel_index(np.argmin(change), change.shape)
        if change[i, j] > -1e-9:
            return order
        order = np.concatenate([order[: i + 1], order[i + 1 : j + 1][::-1], order[j + 1 :]])
