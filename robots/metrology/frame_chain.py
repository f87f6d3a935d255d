"""Chains of frames measured from several positions of a measuring device (leapfrogging).

From its position j the device D_j sees two frames, K_j-1 and K_j; it is moved, sees K_j again and the next
one. Each position gives a link, the second frame in the first, and the product of the links leads from the
first frame to the last (Wilms (2016), chapter 2, prints a sum sign there). If the last frame is the first
one again, the chain is closed and its product should be the identity.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from pydrake.math import RigidTransform

from robots.metrology.frames import three_point_frame
from robots.metrology.least_squares import UndeterminedError
from robots.metrology.point_registration import register_points
from robots.pose import rotation_vector

_SIZE_RATIO = 20.0  # between two sights of one frame; above, their units differ


@dataclass(frozen=True)
class FrameChain:
    """The links of a chain, and how well the points of a frame agreed each time that it was seen again."""

    links: tuple[RigidTransform, ...]  # X_K0K1, X_K1K2, ...
    repeat_rms: tuple[float | None, ...] = ()  # m, of K1, K2, ..., closed: K0; None for three points

    @property
    def X_0N(self) -> RigidTransform:
        """The last frame in the first."""
        return reduce(RigidTransform.multiply, self.links)

    @property
    def closing_angle(self) -> float:
        """The angle of `X_0N` in rad, zero in a closed chain without errors."""
        return float(np.linalg.norm(rotation_vector(self.X_0N.rotation().matrix())))

    @property
    def closing_distance(self) -> float:
        """The distance of the first and the last origin in m, zero in a closed chain without errors."""
        return float(np.linalg.norm(self.X_0N.translation()))


def chain_of_frames(sights: Sequence[np.ndarray], closed: bool = False) -> FrameChain:
    """A chain from the points of its frames, in the order in which they were measured.

    The first three points of a sight are origin, x and y (see `three_point_frame`). If a frame has three,
    they are taken so each time anew, as Wilms (2016) does. If it has more, the first three define it when
    it is first seen; after that it is recognised by all its points, in their order, by least squares.

    Args:
        sights: K0 and K1 from the first position of the device, K1 and K2 from the second, ...; points in
            m, each of shape (n, 3).
        closed: whether the last frame is the first one again.

    Raises:
        UndeterminedError: if a frame is not defined by its points, or two sights of it do not agree; its
            ``part`` is the sight.
        ValueError: if the number of sights is odd or zero.
    """
    if not sights or len(sights) % 2:
        raise ValueError(f"a chain takes two frames from every position, an even number, got {len(sights)}")
    sights = [np.asarray(points, dtype=float) for points in sights]
    X_DK: list[RigidTransform] = []
    repeat_rms: list[float | None] = []
    for part, points in enumerate(sights):
        first = _first_sight(part, len(sights), closed)
        try:
            if len(points) < 3:
                raise UndeterminedError(f"a frame takes at least three points, got {len(points)}")
            X = three_point_frame(points[:3]).X_DK
            if first < part:
                X, rms = _seen_again(X_DK[first], sights[first], X, points)
                repeat_rms.append(rms)
        except UndeterminedError as error:
            raise UndeterminedError(str(error), error.rows, part) from error
        X_DK.append(X)
    links = (X_DK[k].InvertAndCompose(X_DK[k + 1]) for k in range(0, len(sights), 2))
    return FrameChain(tuple(links), tuple(repeat_rms))


def _first_sight(part: int, count: int, closed: bool) -> int:
    """The sight in which the frame of this one was seen first."""
    if closed and part == count - 1:
        return 0
    return part - 1 if part and part % 2 == 0 else part


def _seen_again(
    X_first: RigidTransform, first: np.ndarray, X_again: RigidTransform, again: np.ndarray
) -> tuple[RigidTransform, float | None]:
    """The frame that was seen first at ``X_first``, now that its points are seen ``again``."""
    if len(first) != len(again):
        raise UndeterminedError(f"has {len(again)} points, had {len(first)} when the frame was first seen")
    if len(again) > 3:
        nominal = (first - X_first.translation()) @ X_first.rotation().matrix()
        fit = register_points(nominal, again)
        return fit.X_DK, fit.rms
    sizes = [np.linalg.norm(points - points[0], axis=1).max() for points in (first, again)]
    ratio = sizes[1] / sizes[0]
    if not 1.0 / _SIZE_RATIO < ratio < _SIZE_RATIO:
        raise UndeterminedError(
            f"the frame is {ratio:.3g} times as large as when it was first seen (are units mixed?)"
        )
    return X_again, None
