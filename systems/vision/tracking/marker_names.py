"""Identification of markers by their distances, which the asymmetric arrangement makes unique.

Three points whose distances are those of three markers are a guess at the pose. The guess that brings most
markers to points wins, if no other one that names a point differently brings as many.
"""

from itertools import permutations

import numpy as np
from scipy.spatial import KDTree

from systems.vision.body_pose import fit_poses
from systems.vision.marker_body import MINIMUM_MARKERS, DetectionBody

_MOST_POINTS = 24  # the first ones, which most cameras confirm
_MOST_GUESSES = 5_000


class MarkerNames:
    """Labels points with the markers of one body."""

    def __init__(self, body: DetectionBody, tolerance: float) -> None:
        """Prepares the triples of markers.

        Args:
            body: with m markers.
            tolerance: m, how much a distance between points may differ from that between markers.
        """
        self._p_E, self._tolerance = body.p_E, tolerance
        self._triples = np.array(list(permutations(range(len(body)), 3)))
        self._tree = KDTree(_sides(body.distances, self._triples))

    def name(self, p_W: np.ndarray) -> np.ndarray | None:
        """Which points are which markers.

        Args:
            p_W: points in m, shape (k, 3), in the order of trust; further ones than 24 are not looked at.

        Returns:
            The index of the point of each marker, -1 for none, shape (m,); None if fewer than four points fit
            or if they fit in two ways.
        """
        p_W = p_W[:_MOST_POINTS]
        if len(p_W) < MINIMUM_MARKERS:
            return None
        i, j, k = np.ogrid[: len(p_W), : len(p_W), : len(p_W)]
        triples = np.argwhere((i < j) & (j < k))
        distances = np.linalg.norm(p_W[:, None] - p_W, axis=-1)
        tree = KDTree(_sides(distances, triples))
        guesses = tree.sparse_distance_matrix(self._tree, self._tolerance, p=np.inf, output_type="ndarray")
        if len(guesses) > _MOST_GUESSES:
            guesses = guesses[np.argpartition(guesses["v"], _MOST_GUESSES)[:_MOST_GUESSES]]
        if not len(guesses):
            return None
        markers, points = self._triples[guesses["j"]], triples[guesses["i"]]
        R, p = fit_poses(self._p_E[markers], p_W[points], np.ones(points.shape))
        return self._best(R, p, p_W)

    def _best(self, R: np.ndarray, p: np.ndarray, p_W: np.ndarray) -> np.ndarray | None:
        expected = self._p_E @ R.swapaxes(1, 2) + p[:, None]  # (h, m, 3)
        distance = np.linalg.norm(expected[:, :, None] - p_W, axis=-1)  # (h, m, k)
        nearest = distance.argmin(2)
        gap = np.take_along_axis(distance, nearest[..., None], 2)[..., 0]
        # Of two markers at one point, the nearer one has it.
        mutual = np.take_along_axis(distance.argmin(1), nearest, 1) == np.arange(len(self._p_E))
        fits = mutual & (gap < 2.0 * self._tolerance)
        names = np.where(fits, nearest, -1)
        count = fits.sum(1)
        best = np.lexsort([np.where(fits, gap, 0.0).sum(1), -count])[0]
        if count[best] < MINIMUM_MARKERS:
            return None
        rivals = count >= count[best]
        both = (names >= 0) & (names[best] >= 0)
        contradicts = (both & (names != names[best])).any(1) | (both.sum(1) < MINIMUM_MARKERS)
        return None if (rivals & contradicts).any() else names[best]


def _sides(distances: np.ndarray, triples: np.ndarray) -> np.ndarray:
    """The sides of triangles: from first to second, second to third, third to first corner, (t, 3)."""
    first, second, third = triples.T
    return np.stack([distances[first, second], distances[second, third], distances[third, first]], -1)
