"""Matching of blobs between cameras without prior knowledge of the scene.

Every pair of blobs that lie on each other's epipolar lines is a candidate. It is triangulated and looked for
in the other cameras; the candidate that most cameras confirm takes its blobs, and so on with what remains. A
false blob finds no support, and a merged one is missing in one camera only.
"""

import numpy as np

from systems.vision.camera_model import Cameras
from systems.vision.tracking.epipolar import epipolar_distances, fundamental_matrices, homogeneous

_MOST_CANDIDATES = 20_000  # the best are kept; bounds memory in a room full of reflections


class SceneMatcher:
    """Groups the blobs of n cameras into points."""

    def __init__(self, cameras: Cameras, tolerance: float, min_cameras: int = 3) -> None:
        """Prepares the epipolar geometry.

        Args:
            cameras: n cameras.
            tolerance: px, how far a blob may be from where the others say it is.
            min_cameras: how many must confirm a point; two confirm each other by chance all too often.
        """
        self._cameras, self._tolerance = cameras, tolerance
        self._min_cameras = min(min_cameras, len(cameras))
        self._first, self._second = np.triu_indices(len(cameras), 1)
        self._F = fundamental_matrices(cameras)[self._first, self._second]

    def match(self, blobs: np.ndarray) -> np.ndarray:
        """The points of a scene, those that most cameras confirm first.

        Args:
            blobs: pixels as the lenses show them, shape (n, b, 2), NaN where there is none.

        Returns:
            Indices of blobs, shape (k points, n), -1 where a camera does not see the point.
        """
        pixels = self._cameras.undistort(blobs)
        pair, a, b = self._candidates(pixels)
        p_W = _from_two_views(
            self._cameras.projections[self._first[pair]],
            self._cameras.projections[self._second[pair]],
            pixels[self._first[pair], a],
            pixels[self._second[pair], b],
        )
        index, near = self._support(p_W, pixels)
        return self._greedy(index, near, blobs.shape[1])

    def _candidates(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        distance = epipolar_distances(self._F, pixels[self._first], pixels[self._second])
        found = np.nonzero(distance < self._tolerance)
        if len(found[0]) > _MOST_CANDIDATES:
            best = np.argpartition(distance[found], _MOST_CANDIDATES)[:_MOST_CANDIDATES]
            found = tuple(part[best] for part in found)
        return found[0], found[1], found[2]

    def _support(self, p_W: np.ndarray, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nearest blob to each candidate in each camera, and whether it is near enough; (c, n) each."""
        u, v, w = np.moveaxis(homogeneous(p_W) @ self._cameras.projections.swapaxes(1, 2), -1, 0)  # (n, c)
        with np.errstate(divide="ignore", invalid="ignore"):
            du = (u / w)[:, :, None] - pixels[:, None, :, 0]
            dv = (v / w)[:, :, None] - pixels[:, None, :, 1]
        distance2 = np.where(np.isnan(du) | (w <= 0.0)[:, :, None], np.inf, du * du + dv * dv)
        return distance2.argmin(-1).T, (distance2.min(-1) < self._tolerance**2).T

    def _greedy(self, index: np.ndarray, near: np.ndarray, num_blobs: int) -> np.ndarray:
        free = np.ones((len(self._cameras), num_blobs), bool)
        camera = np.arange(len(self._cameras))
        points = []
        while len(near):
            near = near & free[camera, index]
            count = near.sum(1)
            keep = count >= self._min_cameras
            if not keep.any():
                break
            best = count.argmax()
            points.append(np.where(near[best], index[best], -1))
            free[camera[near[best]], index[best][near[best]]] = False
            index, near = index[keep], near[keep]
        return np.array(points, dtype=int).reshape(-1, len(self._cameras))


def blobs_of_points(blobs: np.ndarray, index: np.ndarray) -> np.ndarray:
    """The pixels of points: blobs (n, b, 2) and indices (n, k) with -1 for none to (n, k, 2) with NaN."""
    pixels = blobs[np.arange(len(blobs))[:, None], index]
    pixels[index < 0] = np.nan
    return pixels


def _from_two_views(P_1: np.ndarray, P_2: np.ndarray, x_1: np.ndarray, x_2: np.ndarray) -> np.ndarray:
    """Points (c, 3) from c pairs of pixels (c, 2) and their projection matrices (c, 3, 4)."""
    A = np.concatenate(
        [x_1[..., None] * P_1[:, None, 2] - P_1[:, :2], x_2[..., None] * P_2[:, None, 2] - P_2[:, :2]], axis=1
    )
    normal = A.swapaxes(1, 2) @ A
    scale = np.einsum("cii->c", normal[:, :3, :3])[:, None, None]
    left = normal[:, :3, :3] / scale + 1e-15 * np.eye(3)  # parallel rays lead far away, not to an error
    return -np.linalg.solve(left, normal[:, :3, 3:] / scale)[..., 0]
