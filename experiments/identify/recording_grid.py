"""The even times of a recorded motion: samples that were lost on the way are filled in where they are few."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from experiments.cli.console import count
from robots.identification.recording import RecordingError

UNEVEN = 0.01  # of the period, by which samples of the robot may be off an even grid
_IN_A_ROW = 3  # samples that may be missing between two
_SHARE = 0.01  # of all samples of a motion that may be missing


@dataclass(frozen=True)
class EvenGrid:
    """Where the n samples of a motion stand among the m of an even grid, m - n of which are missing."""

    rows: np.ndarray  # (n,) of the samples on the grid, from 0 to m - 1
    longest_gap: float  # s, between two samples

    @property
    def size(self) -> int:
        """Samples with those that are missing."""
        return int(self.rows[-1]) + 1

    @property
    def missing(self) -> int:
        """How many samples are."""
        return self.size - len(self.rows)

    def smooth(self, values: np.ndarray) -> np.ndarray:
        """What changes smoothly, such as positions, (n, ...), on the grid by a cubic spline, (m, ...)."""
        if not self.missing:
            return values
        return self._filled(values, CubicSpline(self.rows, values)(np.arange(self.size)))

    def linear(self, values: np.ndarray) -> np.ndarray:
        """What has noise or steps, such as torques, (n, ...), on the grid by straight lines, (m, ...)."""
        if not self.missing:
            return values
        flat = values.reshape(len(values), -1)
        lines = [np.interp(np.arange(self.size), self.rows, column) for column in flat.T]
        return self._filled(values, np.stack(lines, axis=-1).reshape(self.size, *values.shape[1:]))

    def following(self, values: np.ndarray) -> np.ndarray:
        """What is held from one change to the next, such as commands: a missing one is the one behind it."""
        return values[np.searchsorted(self.rows, np.arange(self.size))]

    def _filled(self, values: np.ndarray, between: np.ndarray) -> np.ndarray:
        between[self.rows] = values
        return between


def even_grid(where: Callable[[int], str], time: np.ndarray) -> EvenGrid:
    """Finds the grid of a motion.

    Args:
        where: the place of a sample, for messages.
        time: of the samples in s, rising, (n,).

    Raises:
        RecordingError: if samples lie off an even grid, or more than a few are missing; names the place.
    """
    steps = np.diff(time)
    period = float(np.median(steps))
    periods = np.maximum(np.rint(steps / period), 1.0)
    off = np.abs(steps - periods * period)
    grid = EvenGrid(np.concatenate([[0], np.cumsum(periods)]).astype(int), float(steps.max()))
    if off.max() > UNEVEN * period:
        row, why = int(np.argmax(off)), ""
    elif periods.max() > _IN_A_ROW + 1:
        row = int(np.argmax(periods))
        why = f": {periods[row] - 1:.0f} in a row are missing, up to {_IN_A_ROW} are filled in"
    elif grid.missing > _SHARE * grid.size:
        row = int(np.argmax(periods > 1.0))
        why = f": {grid.missing} of {grid.size} are missing, up to {100.0 * _SHARE:g} % are filled in"
    else:
        return grid
    raise RecordingError(
        f"{where(row + 1)}: samples of the robot must be evenly spaced, got {steps[row]:g} s after "
        f"{period:g} s{why}"
    )


def filled_note(path: Path, grids: Sequence[EvenGrid]) -> str:
    """How many samples of a file were filled in, in a sentence; nothing if none was missing."""
    missing = sum(grid.missing for grid in grids)
    if not missing:
        return ""
    longest = max(grid.longest_gap for grid in grids if grid.missing)
    of = count(sum(grid.size for grid in grids), "sample")
    return (
        f"{path}: {missing} of {of} of the robot {'is' if missing == 1 else 'are'} missing and filled in by "
        f"interpolation, the longest gap is {longest:.3g} s"
    )
