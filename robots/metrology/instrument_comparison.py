"""Two instruments that followed the same motion: their clocks, their frames, and which of the two is wrong.

Both clocks are brought together by the speed of what they see, which no frame changes; then lag, frame and
the offset of the second one's target from the tool are adjusted together. What is left, d12, is the error of
the first minus that of the second. With a third that is wrong in its own way, such as the robot's joints,
the share of the first is that of d12 which its difference from the third has, too:
mean(d12 d13) / mean(d12 d12) (Grubbs 1948). Its standard error is that of a jackknife over stretches of
the motion.
"""

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from robots.metrology.point_registration import register_points
from robots.metrology.time_alignment import AlignmentError, align

_GRID = 0.01  # s, of the speeds
_COMMON = 1.0  # s
_STRETCHES = 10  # of the jackknife
_TURNS = 0.2  # rad, by which the tool must turn for an offset in it to be seen


@dataclass(frozen=True)
class Followed:
    """What an instrument saw of a motion, n samples in rising order of their own clock."""

    time: np.ndarray  # (n,) s
    position: np.ndarray  # (n, 3) m
    rotation: np.ndarray | None = None  # (n, 3, 3); None where it sees points


@dataclass(frozen=True)
class Fit:
    """The second recording brought to the clock and the frame of the first."""

    lag: float  # s, by which stamps of the second are late
    X_12: RigidTransform  # the frame of the second in that of the first
    offset: np.ndarray  # (3,) m, of the second one's target in the frame of the tool
    time: np.ndarray  # (k,) s, of the samples of the first that both have
    residual: np.ndarray  # (k, 3) m, first minus second, in the frame of the first

    @property
    def rms(self) -> float:
        """Root mean square of the distances in m."""
        return float(np.sqrt(np.mean(np.sum(self.residual**2, axis=1))))


@dataclass(frozen=True)
class Share:
    """How much of what two instruments differ by is the error of the first."""

    first: float  # of the mean square; the second has the rest
    sigma: float  # standard error

    @property
    def culprit(self) -> str:
        """``first``, ``second``, ``both``, or nothing where it cannot be told."""
        if self.sigma > 0.2:
            return ""
        if self.first > 0.5 + 2.0 * self.sigma and self.first > 0.7:
            return "first"
        if self.first < 0.5 - 2.0 * self.sigma and self.first < 0.3:
            return "second"
        return "both"


def fitted(first: Followed, second: Followed, window: float = 2.0) -> Fit:
    """Finds lag, frame and offset of the second recording.

    Args:
        first: with rotations, of the tool.
        second: of a target that the tool carries.
        window: largest lag in s.

    Raises:
        AlignmentError: if the two do not show one motion, or have too little time in common.
        UndeterminedError: if the motion is a line.
    """
    low, high = max(first.time[0], second.time[0]), min(first.time[-1], second.time[-1])
    if high - low < _COMMON:
        raise AlignmentError(
            f"the recordings have {max(0.0, high - low):.2f} s in common, at least {_COMMON:g} s are needed "
            "(do both clocks begin with the run?)"
        )
    grid = np.arange(low, high, _GRID)
    lag = align(_speed(first, grid), _speed(second, grid), _GRID, min(window, 0.4 * (high - low))).lag
    inside = (first.time + lag - 0.05 > second.time[0]) & (first.time + lag + 0.05 < second.time[-1])
    time, p_1 = first.time[inside], first.position[inside]
    seen = CubicSpline(second.time, second.position)
    rotation = None if first.rotation is None else first.rotation[inside]
    turned = (
        0.0
        if rotation is None
        else (Rotation.from_matrix(rotation[0]).inv() * Rotation.from_matrix(rotation)).magnitude().max()
    )
    has_offset = rotation is not None and turned > _TURNS
    start = register_points(seen(time + lag), p_1).X_DK

    def residuals(x: np.ndarray) -> np.ndarray:
        R = Rotation.from_rotvec(x[:3]).as_matrix() @ start.rotation().matrix()
        target = p_1 + rotation @ x[7:] if has_offset and rotation is not None else p_1
        return (target - seen(time + lag + x[6]) @ R.T - start.translation() - x[3:6]).ravel()

    found = least_squares(
        residuals, np.zeros(10 if has_offset else 7), x_scale="jac", xtol=1e-10, ftol=1e-10, max_nfev=30
    ).x
    R = RotationMatrix(Rotation.from_rotvec(found[:3]).as_matrix()) @ start.rotation()
    X_12 = RigidTransform(R, start.translation() + found[3:6])
    offset = found[7:] if has_offset else np.zeros(3)
    return Fit(lag + float(found[6]), X_12, offset, time, residuals(found).reshape(-1, 3))


def share_of_first(second: Fit, third: Fit) -> Share:
    """Which part of the residual of the second is the error of the first, by the residual of a third.

    Args:
        second: fitted to the first.
        third: fitted to the first, too; its errors must be its own.
    """
    common = np.isin(second.time, third.time)
    d12, d13 = second.residual[common], third.residual[np.isin(third.time, second.time)]
    product, square = np.sum(d12 * d13, axis=1), np.sum(d12 * d12, axis=1)
    # Jackknife: without each stretch in turn.
    stretches = np.array_split(np.arange(len(product)), _STRETCHES)
    without = np.array(
        [np.delete(product, stretch).sum() / np.delete(square, stretch).sum() for stretch in stretches]
    )
    n = len(without)
    sigma = float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))
    return Share(float(product.sum() / square.sum()), sigma)


def _speed(followed: Followed, grid: np.ndarray) -> np.ndarray:
    """Speed in m/s at the times of a grid in s."""
    way = np.column_stack([np.interp(grid, followed.time, axis) for axis in followed.position.T])
    return np.linalg.norm(np.gradient(way, _GRID, axis=0), axis=1) if len(grid) > 1 else np.zeros(len(grid))
