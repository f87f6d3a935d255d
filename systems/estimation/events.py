"""Whether camera and estimate still agree: outliers, a displaced tool, a load picked up or put down."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from systems.estimation.memory import Layout
from systems.estimation.tip_model import TipModel

_WINDOW = 12.0  # samples of the running mean
_SUSPICIOUS = 4.0, 1.0  # sigmas of the camera alone, of one sample and of the mean: below, nothing is to do
_OUTLIER, _LONGEST_OUTLIER = 6.0, 5  # sigmas; and how many samples in a row may be so called
_JUMP = 9.0  # sigmas of the mean
_FIRST = 15  # samples, whose median is what the next ones are compared with
_MARGIN = np.repeat([3e-3, 1e-3], 3)  # rad and m, what the first linearisations may be wrong by
_PAUSE = 50  # samples after an event before the next one
_EXPLAINED = 0.15  # what a cause leaves of the mean error if it is the cause


TOOL_DISPLACED, LOAD_CHANGED, DEAD_TIME_CHANGED = "tool displaced", "load changed", "dead time changed"


class Verdict(NamedTuple):
    """What a sample says."""

    is_outlier: bool = False
    has_jumped: bool = False


class Event(NamedTuple):
    """What happened to the robot."""

    kind: str  # "tool displaced", "load changed" or "dead time changed"
    size: float  # m, kg or s
    error: float  # m, of the tip where it is known


class Innovations:
    """The running mean of what samples say beyond the estimate, in units of what both may be wrong by.

    Samples of a camera are independent, so that the mean of a window w is smaller by sqrt(2 w - 1).
    """

    def __init__(self, variances: np.ndarray) -> None:
        """Takes the variances of one sample, (6,)."""
        self._variances = variances
        self.layout = Layout(mean=(6,), error=(6,), outliers=(1,), pause=(1,), seen=(1,), first=(_FIRST, 6))

    def is_false_start(
        self, memory: SimpleNamespace, r: np.ndarray, H: np.ndarray, solve: Callable[[], np.ndarray]
    ) -> bool:
        """Whether one of the first innovations is an outlier, or too early to tell. Arguments as of `judge`.

        The very first samples only say where the others have to be: nothing is known then that would tell a
        reflection from a robot that is elsewhere.
        """
        seen = int(memory.seen[0])
        if seen < _FIRST:
            memory.first[seen] = r
            memory.seen[0] += 1.0
            return True
        if seen < 2 * _FIRST:
            memory.seen[0] += 1.0
            return bool((np.abs(r - np.median(memory.first, axis=0)) > _OUTLIER * _MARGIN).any())
        spread = _MARGIN
        if (np.abs(r) > _OUTLIER * _MARGIN).any():
            spread = np.sqrt(self._variances + _MARGIN**2 + np.einsum("ij,ji->i", H, solve()))
        if (np.abs(r) < _OUTLIER * spread).all() or memory.outliers[0] >= _LONGEST_OUTLIER:
            memory.outliers[0] = 0.0
            return False
        memory.outliers[0] += 1.0
        return True

    def judge(
        self, memory: SimpleNamespace, r: np.ndarray, H: np.ndarray, solve: Callable[[], np.ndarray]
    ) -> Verdict:
        """Takes one innovation.

        Args:
            memory: of the layout.
            r: the pose error, (6,).
            H: its columns, (6, n).
            solve: gives P H^T, (n, 6), with the covariance P of the estimate; called where it matters.
        """
        z = r / np.sqrt(self._variances)
        single, lasting = _SUSPICIOUS
        if np.abs(z).max() > single or np.abs(memory.mean).max() > lasting:
            z = r / np.sqrt(self._variances + np.einsum("ij,ji->i", H, solve()))
        memory.pause[0] = max(0.0, memory.pause[0] - 1.0)
        if np.abs(z).max() > _OUTLIER and memory.outliers[0] < _LONGEST_OUTLIER:
            memory.outliers[0] += 1.0
            return Verdict(is_outlier=True)
        # Samples that were left out count as soon as there are too many of them in a row to be outliers.
        share = 1.0 - (1.0 - 1.0 / _WINDOW) ** (1.0 + memory.outliers[0] * (np.abs(z).max() > _OUTLIER))
        memory.mean += share * (z - memory.mean)
        memory.error += share * (r - memory.error)
        memory.outliers[0] = 0.0
        jumped = np.abs(memory.mean).max() * np.sqrt(2.0 * _WINDOW - 1.0) > _JUMP
        return Verdict(has_jumped=bool(jumped and memory.pause[0] == 0.0))

    def explain(self, memory: SimpleNamespace, H: np.ndarray, model: TipModel) -> Event:
        """Says what the mean error looks like, and begins anew."""
        error, whitened = memory.error.copy(), memory.error / np.sqrt(self._variances)
        by_load = H[:, model.M] / np.sqrt(self._variances)[:, None]
        change = np.linalg.lstsq(by_load[:, :1], whitened, rcond=None)[0]
        left = whitened - by_load[:, :1] @ change
        memory.mean[:], memory.error[:], memory.outliers[0], memory.pause[0] = 0.0, 0.0, 0.0, _PAUSE
        # The running mean has seen the change for a part of its window only.
        size = float(np.linalg.norm(error[3:]))
        if left @ left < _EXPLAINED * (whitened @ whitened):
            return Event(LOAD_CHANGED, float(change[0] * model.sigma[model.M][0]), size)
        return Event(TOOL_DISPLACED, size, size)
