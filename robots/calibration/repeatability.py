"""What repeated measurements of one configuration say, without any model: the repeatability."""

from dataclasses import dataclass

import numpy as np

from robots.calibration.identified import Identified

_SAME = 1e-3  # rad: encoders tell two visits of one configuration apart by less


@dataclass(frozen=True)
class Repeatability:
    """Standard deviations of one measurement about the mean of its configuration, per coordinate."""

    configurations: int  # that were measured more than once
    rows: int  # that did so
    position_mm: float
    rotation_deg: float | None  # None where no orientation was measured


def repeatability(identified: Identified) -> Repeatability | None:
    """The spread of residuals within groups of rows at one configuration and load; None if there are none.

    Residuals in place of poses, because encoders read each visit a little differently.
    """
    table, residuals = identified.measurements, identified.residuals
    squares, freedom, groups, rows = np.zeros(residuals.shape[1]), 0, 0, 0
    for group in _groups(np.column_stack([table.q, table.payload]), identified.kept):
        e = residuals[group]
        squares += np.sum((e - e.mean(axis=0)) ** 2, axis=0)
        freedom, groups, rows = freedom + len(group) - 1, groups + 1, rows + len(group)
    if not groups:
        return None
    sigma = np.sqrt(squares / freedom)
    position = 1e3 * float(np.sqrt(np.mean(sigma[-3:] ** 2)))
    rotation = float(np.rad2deg(np.sqrt(np.mean(sigma[:-3] ** 2)))) if len(sigma) == 6 else None
    return Repeatability(groups, rows, position, rotation)


def _groups(keys: np.ndarray, kept: np.ndarray) -> list[np.ndarray]:
    """Indices of kept rows with the same numbers, groups of two and more."""
    left, groups = list(np.flatnonzero(kept)), []
    while left:
        is_near = np.abs(keys[left] - keys[left[0]]).max(axis=1) < _SAME
        if is_near.sum() > 1:
            groups.append(np.array(left)[is_near])
        left = [row for row, near in zip(left, is_near, strict=True) if not near]
    return groups
