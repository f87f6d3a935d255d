"""Measurements from a recording in which a robot rests now and then: a row for every dwell.

A robot rests where no joint has moved by more than a hundredth of a degree for as long as it takes to settle
and to measure. What was exposed before it had settled is not used, whatever the camera's rate: a slow camera
whose newest exposure shows the robot on its way gives no row from it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial.transform import Rotation

from robots.calibration.measurements import Measurements
from robots.kinematics.forward import Kinematics
from robots.metrology.time_alignment import AlignmentError, align

_STILL = np.deg2rad(0.01)  # rad, by which a joint that rests may move
_GAP = 0.2  # s without a sample of the joints: nobody knows that they rested
_GRID, _LARGEST_LAG = 0.01, 0.4  # s; a larger lag would let motion into what counts as settled


class RecordingError(ValueError):
    """A recording that holds nothing to calibrate with."""


@dataclass(frozen=True)
class DwellRule:
    """What counts as a measurement at rest."""

    settle: float = 0.5  # s of rest before the first exposure that counts
    mean: float = 1.0  # s, over which is averaged; longer where a slow camera needs it
    fewest_exposures: int = 3

    def __post_init__(self) -> None:
        """Raises ValueError if a length of time is not positive or one exposure would be enough."""
        if not (0.0 < self.settle <= 60.0 and 0.0 < self.mean <= 60.0 and self.fewest_exposures >= 2):
            raise ValueError(
                "a dwell needs a settling time and a mean of 0 to 60 s and 2 or more exposures, got "
                f"{self.settle} s, {self.mean} s and {self.fewest_exposures}"
            )


@dataclass(frozen=True)
class Recording:
    """Joints and exposures of one motion."""

    time: np.ndarray  # (n,) s, of the joints
    q: np.ndarray  # (n, 6) rad
    exposed: np.ndarray  # (m,) s, on a clock that may be off by a few tenths of a second
    X_WE: np.ndarray  # (m, 4, 4)


def rests(time: np.ndarray, q: np.ndarray, shortest: float) -> list[tuple[float, float]]:
    """Begin and end in s of every rest of ``shortest`` s or more, from joints (n, 6) in rad at times (n,)."""
    if len(time) < 2 or time[-1] - time[0] < shortest:
        return []
    period = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1], period)
    samples = np.column_stack([np.interp(grid, time, joint) for joint in q.T])
    for k in np.flatnonzero(np.diff(time) > _GAP):
        samples[(grid > time[k]) & (grid < time[k + 1])] = np.nan
    width = max(2, round(shortest / period)) + 1
    if width > len(grid):
        return []

    def windows(filler: float) -> np.ndarray:
        return sliding_window_view(np.nan_to_num(samples, nan=filler), width, axis=0)

    # A window with a gap swings without limit.
    is_rest = (windows(np.inf).max(axis=-1) - windows(-np.inf).min(axis=-1) <= _STILL).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_rest.astype(int), [0]])))
    return [(float(grid[begin]), float(grid[end + width - 2])) for begin, end in edges.reshape(-1, 2)]


def mean_at_rest(
    recording: Recording, begin: float, end: float, rule: DwellRule
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Mean joints (6,) in rad, position (3,) in m and rotation (3, 3) of a rest; None if it was not seen.

    Args:
        recording: with exposures in rising order, on the clock of its joints.
        begin: of the rest in s.
        end: of the rest in s.
        rule: what to average.
    """
    first = begin + rule.settle
    seen = np.flatnonzero((recording.exposed >= first) & (recording.exposed <= end))
    if len(seen) < rule.fewest_exposures:
        return None
    last = min(end, max(first + rule.mean, float(recording.exposed[seen[rule.fewest_exposures - 1]])))
    seen = seen[recording.exposed[seen] <= last]
    inside = (recording.time >= first) & (recording.time <= last)
    X = recording.X_WE[seen]
    rotation = Rotation.from_matrix(X[:, :3, :3]).mean().as_matrix()
    return recording.q[inside].mean(axis=0), X[:, :3, 3].mean(axis=0), rotation


def lag_of_exposures(recording: Recording, kinematics: Kinematics) -> float:
    """By how many seconds the stamps of the exposures are late, from the speed of the tool in both.

    Raises:
        RecordingError: if the two are not of one motion.
    """
    low = max(recording.time[0], recording.exposed[0])
    high = min(recording.time[-1], recording.exposed[-1])
    grid = np.arange(low, high, _GRID)
    if len(grid) < 2.0 * _LARGEST_LAG / _GRID:
        raise RecordingError(f"joints and exposures have only {max(0.0, high - low):.2f} s in common")
    q = np.column_stack([np.interp(grid, recording.time, joint) for joint in recording.q.T])
    seen = recording.X_WE[:, :3, 3]
    camera = np.column_stack([np.interp(grid, recording.exposed, axis) for axis in seen.T])
    # Speeds: they are zero at both ends, where positions would pull the lag towards nothing.
    robot, seen = (np.gradient(way, axis=0) for way in (kinematics.forward(q)[:, :3, 3], camera))
    try:
        return align(robot, seen, _GRID, _LARGEST_LAG).lag
    except AlignmentError as error:
        raise RecordingError(f"joints and exposures do not show the same motion: {error}") from error


def dwell_measurements(
    recording: Recording, kinematics: Kinematics, rule: DwellRule | None = None, payload: float = 0.0
) -> tuple[Measurements, float]:
    """The table of a recording, a row for each dwell, and the lag in s by which exposures were moved.

    Args:
        recording: in any order of exposures.
        kinematics: of the nominal robot, for the alignment of the clocks alone.
        rule: what a dwell is.
        payload: at the flange in kg.

    Raises:
        RecordingError: if there is no dwell, none was seen often enough, or the clocks cannot be aligned.
    """
    rule = rule or DwellRule()
    if len(recording.time) < 2 or len(recording.exposed) < rule.fewest_exposures:
        raise RecordingError(
            f"{len(recording.time)} samples of the joints and {len(recording.exposed)} exposures are too few"
        )
    found = rests(recording.time, recording.q, rule.settle + rule.mean)
    if not found:
        raise RecordingError(
            f"the robot nowhere rests for {rule.settle + rule.mean:g} s ({rule.settle:g} s to settle, "
            f"{rule.mean:g} s to measure): there is no dwell to calibrate with"
        )
    order = np.argsort(recording.exposed, kind="stable")
    in_order = Recording(recording.time, recording.q, recording.exposed[order], recording.X_WE[order])
    lag = lag_of_exposures(in_order, kinematics)
    aligned = Recording(recording.time, recording.q, in_order.exposed - lag, in_order.X_WE)
    rows = [(n, mean_at_rest(aligned, *rest, rule)) for n, rest in enumerate(found, 1)]
    seen = [(number, row) for number, row in rows if row is not None]
    if not seen:
        raise RecordingError(
            f"none of {len(found)} dwells has {rule.fewest_exposures} exposures after "
            f"{rule.settle:g} s of rest"
        )
    q, position, rotation = (np.array([row[part] for _, row in seen]) for part in range(3))
    numbers = np.array([number for number, _ in seen])
    return Measurements(q, position, rotation, np.full(len(seen), payload), numbers), lag
