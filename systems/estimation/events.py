"""Whether camera and estimate still agree: outliers, a displaced tool, a load picked up or put down."""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from systems.estimation import kernels
from systems.estimation.memory import Layout
from systems.estimation.tip_model import TipModel

_WINDOW = 12.0  # samples of the running mean
_AVERAGING = math.sqrt(2.0 * _WINDOW - 1.0)  # times, by which the noise of the mean is smaller
_SUSPICIOUS = 4.0  # sigmas of the camera alone, of one sample: below, nothing is to do
# Sigmas; and how many samples in a row may be so called that do not agree with each other: of reflections in
# every fifth image so many come in a row once in some months.
_OUTLIER, _LONGEST_OUTLIER = 6.0, 12
_JUMP, _CALM = 9.0, 4.0  # sigmas of the mean: what no parameter describes lasts longer than noise
_MODEL_SHARE = 3.0 / _JUMP  # what the estimate is wrong by is within 5 sigmas
_FIRST = 15  # samples, whose median is what the next ones are compared with
_MARGIN = np.repeat([3e-3, 1e-3], 3)  # rad and m, what the first linearisations may be wrong by
_RECENT = 24  # samples, among which a change is looked for that came from one to the next
_AFTER = 3  # of them at least have to be behind it
_SUDDEN = 60.0  # by which chi squared is smaller with a step than with a parabola: e to the 30 to one
_FOREIGN = 8.0  # sigmas of what robots of this kind may be off by
_PAUSE = 50  # samples after an event before the next one
_SCATTER, _LEAST_SCATTER = 500, 100  # samples, in the mean of the camera's noise; and before it is said
_MOST_SCATTER = 9.0  # times that mean, by a single change
_EXPLAINED = 0.15  # what a cause leaves of the mean error if it is the cause


TOOL_DISPLACED, LOAD_CHANGED = "tool displaced", "load changed"
DEAD_TIME_CHANGED = "dead time changed"
FOREIGN_FRAME = "camera frame is another"
CAMERA_MOVED = "camera moved"
LOAD_UNLIKE_BELIEF = "load unlike belief"  # from the start, by about so much
PROBE_REPEATED = "probe repeated"  # the tip was known no better than so where the path begins
GAINS_UNLIKE_BELIEF = "drive gains unlike belief"  # so many times as far motors give way to a torque
JOINTS_SHIFTED = "joints shifted"  # against their encoders
TOOL_OR_CAMERA = "tool or camera displaced"  # until the robot has turned the tool far enough to tell
PATH_UNSEEN = "path needs more than was shown"
IMPLAUSIBLE = "estimate implausible"  # so many parameters are beyond all bounds: they are kept at them
_UNITS = {  # others: m
    LOAD_CHANGED: "kg",
    LOAD_UNLIKE_BELIEF: "kg",
    DEAD_TIME_CHANGED: "s",
    FOREIGN_FRAME: "rad",
    JOINTS_SHIFTED: "rad",
    IMPLAUSIBLE: "parameters",
    GAINS_UNLIKE_BELIEF: "times",
}


class Verdict(NamedTuple):
    """What a sample says."""

    is_outlier: bool = False
    has_jumped: bool = False  # by more than the estimate explains, from one sample to the next
    has_drifted: bool = False  # by more than that, for long and as slowly as the robot moves
    is_doubtful: bool = False  # one of both, but it is too early to tell
    is_calm: bool = False


class Event(NamedTuple):
    """What happened to the robot."""

    kind: str  # one of those above
    size: float  # m, kg, s or rad, a number of parameters, or a factor
    error: float  # m, of the tip where it is known


class EventLog:
    """The last events with their times, for whoever asks what happened."""

    _LENGTH = 8
    _KINDS = (
        TOOL_DISPLACED,
        LOAD_CHANGED,
        DEAD_TIME_CHANGED,
        FOREIGN_FRAME,
        PATH_UNSEEN,
        CAMERA_MOVED,
        TOOL_OR_CAMERA,
        IMPLAUSIBLE,
        JOINTS_SHIFTED,
        LOAD_UNLIKE_BELIEF,
        GAINS_UNLIKE_BELIEF,
        PROBE_REPEATED,
    )

    def __init__(self) -> None:
        """Lays out the memory."""
        self.layout = Layout(rows=(self._LENGTH, 4), count=(1,))

    def note(self, memory: SimpleNamespace, time: float, event: Event) -> None:
        """Adds an event at a time in s; the oldest one is forgotten."""
        count = int(memory.count[0])
        memory.rows[count % self._LENGTH] = time, self._KINDS.index(event.kind), event.size, event.error
        memory.count[0] = count + 1

    def read(self, memory: SimpleNamespace) -> list[dict[str, Any]]:
        """The last events, oldest first: ``time_s``, ``kind``, ``size``, its ``unit`` and ``tip_error_m``."""
        count = int(memory.count[0])
        rows = [memory.rows[k % self._LENGTH].tolist() for k in range(max(0, count - self._LENGTH), count)]
        return [
            {
                "time_s": time,
                "kind": self._KINDS[int(kind)],
                "size": size,
                "unit": _UNITS.get(self._KINDS[int(kind)], "m"),
                "tip_error_m": error,
            }
            for time, kind, size, error in rows
        ]


class Innovations:
    """The running mean of what samples say beyond the estimate, in units of what both may be wrong by.

    The noise of a camera is independent from sample to sample: in a mean over a window w it is smaller by
    sqrt(2 w - 1). What the estimate is wrong by is the same in all of them: the mean has the variance
    R / (2 w - 1) + H P H^T.

    A tool is displaced and a load is gripped from one sample to the next. What the model lacks, or what was
    linearised too far off, shows as slowly as the robot moves. So the last samples are compared with a step
    and with a parabola.
    """

    def __init__(self, variances: np.ndarray) -> None:
        """Takes the variances of one sample, (6,)."""
        self._variances = variances
        powers = np.linspace(-1.0, 1.0, _RECENT)[:, None] ** np.arange(3)
        self._parabolas = np.linalg.qr(powers)[0]
        self.layout = Layout(
            variances=(6,),  # of the camera, as samples are judged now
            error=(6,),
            spread=(6,),  # what the estimate could be wrong by when these errors were seen, in sigmas
            outliers=(1,),
            left_out=(6,),  # the last large error
            pause=(1,),
            seen=(1,),
            first=(_FIRST, 6),
            recent=(_RECENT, 6),  # the newest one last
            by_model=(_RECENT, 6),  # what the estimate could be wrong by then, in variances of the camera
            held=(1,),  # how many of them there are
            doubtful=(1,),  # samples in a row
            last=(6,),
            scatter=(6,),  # variances of the camera, from one sample to the next
            changes=(1,),  # in that mean
        )

    def start(self, memory: SimpleNamespace) -> None:
        """Writes what is believed before the first sample."""
        memory.variances[:] = self._variances

    def use(self, memory: SimpleNamespace, variances: np.ndarray) -> None:
        """Judges by other variances of a sample, (6,), from now on."""
        memory.variances[:] = variances
        self.forget(memory)

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
            spread = np.sqrt(memory.variances + _MARGIN**2 + np.einsum("ij,ji->i", H, solve()))
        if (np.abs(r) < _OUTLIER * spread).all() or memory.outliers[0] >= _LONGEST_OUTLIER:
            memory.outliers[0] = 0.0
            return False
        memory.outliers[0] += 1.0
        return True

    def foreign(self, memory: SimpleNamespace, H: np.ndarray) -> Event | None:
        """That the camera speaks of another frame: no robot of this kind is off by what it says.

        Args:
            memory: of the layout.
            H: columns of the tip in units of the spreads before anything was measured, (6, n).
        """
        r = np.median(memory.first, axis=0)
        if int(memory.seen[0]) < _FIRST or (np.abs(r) < _FOREIGN * np.sqrt((H * H).sum(axis=1))).all():
            return None
        return Event(FOREIGN_FRAME, float(np.linalg.norm(r[:3])), float(np.linalg.norm(r[3:])))

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
        memory.pause[0] = max(0.0, memory.pause[0] - 1.0)
        means = memory.error, memory.spread, memory.recent, memory.by_model
        by_model, number = None, 1  # what the estimate may be wrong by, in variances of the camera
        size = kernels.innovations.enter_usual(r, memory.variances, _SUSPICIOUS, _share(1), *means)
        if size < 0.0:
            by_model = np.einsum("ij,ji->i", H, solve()) / memory.variances
            number = self._number(memory, r, by_model)
            if not number:
                return Verdict(is_outlier=True)
            size = kernels.innovations.enter(r, by_model, number, _share(number), memory.variances, *means)
        memory.outliers[0] = 0.0
        memory.held[0] += number
        size *= _AVERAGING
        if size > _CALM:
            if by_model is None:
                by_model = np.einsum("ij,ji->i", H, solve()) / memory.variances
            memory.by_model[-1] = by_model
            by_model = np.maximum(by_model, memory.spread**2)
            mean = np.abs(memory.error) / np.sqrt(memory.variances)
            size = (mean / np.sqrt(_AVERAGING**-2 + _MODEL_SHARE**2 * by_model)).max()
        if size > _CALM and memory.pause[0] == 0.0 and self._is_sudden(memory):
            return Verdict(has_jumped=True)
        if size <= _JUMP or memory.pause[0] > 0.0:
            memory.doubtful[0] = 0.0
            return Verdict(is_calm=bool(size < _CALM))
        memory.doubtful[0] += 1.0
        is_long = memory.doubtful[0] > _RECENT // 2
        return Verdict(has_drifted=bool(is_long), is_doubtful=not is_long)

    def _number(self, memory: SimpleNamespace, r: np.ndarray, by_model: np.ndarray) -> int:
        """How many samples an innovation (6,) stands for; none if it is an outlier.

        Samples that were left out count as soon as they agree, or are too many in a row to be outliers.
        """
        if kernels.innovations.largest(r, memory.variances * (1.0 + by_model)) <= _OUTLIER:
            return 1
        # Reflections lie anywhere; a tool that was displaced is seen at the same place again.
        is_again = kernels.innovations.largest(r - memory.left_out, memory.variances) < _OUTLIER
        memory.left_out[:] = r
        if memory.outliers[0] < _LONGEST_OUTLIER and not is_again:
            memory.outliers[0] += 1.0
            return 0
        return 1 + int(memory.outliers[0])

    def measure_noise(self, memory: SimpleNamespace, r: np.ndarray) -> bool:
        """Takes the innovation of a sample that counts, (6,), into the measured noise of the camera.

        What model and estimate are wrong by is nearly the same in the sample before: half of the square of
        the change is noise alone.

        Returns:
            Whether enough has come for `noise_factor`.
        """
        if memory.changes[0] == 0.0:
            memory.last[:] = r
        share = 1.0 / min(max(float(memory.changes[0]), 1.0), _SCATTER)
        means = memory.last, memory.scatter
        kernels.innovations.scatter(r, *means, memory.variances, _MOST_SCATTER, share)
        memory.changes[0] += 1.0
        return bool(memory.changes[0] >= _LEAST_SCATTER)

    def noise_factor(self, memory: SimpleNamespace) -> float:
        """The camera's variance as it is measured in units of the one that is believed.

        The larger factor of turns and of shifts: what both say is mixed in the estimate.
        """
        if memory.changes[0] < _LEAST_SCATTER:
            return 1.0
        return float((memory.scatter / memory.variances).reshape(2, 3).sum(axis=1).max()) / 3.0

    def _is_sudden(self, memory: SimpleNamespace) -> bool:
        """Whether a step explains the last samples better than a parabola does."""
        if memory.held[0] < _RECENT:
            return False
        y = self._in_sigmas(memory)
        smooth = float((y * y).sum() - ((self._parabolas.T @ y) ** 2).sum())
        return smooth - float(_with_step(y).min()) > _SUDDEN

    def _in_sigmas(self, memory: SimpleNamespace) -> np.ndarray:
        """The last samples in units of what both camera and estimate may be wrong by."""
        by_model = np.maximum(memory.by_model, memory.by_model[-1])
        return memory.recent / np.sqrt(memory.variances * (1.0 + by_model))

    def forget(self, memory: SimpleNamespace) -> None:
        """Begins the mean anew."""
        memory.error[:], memory.spread[:] = 0.0, 0.0
        memory.outliers[0], memory.held[0], memory.doubtful[0] = 0.0, 0.0, 0.0

    def rest(self, memory: SimpleNamespace) -> None:
        """Begins anew after an event, and finds none for a while."""
        self.forget(memory)
        memory.pause[0] = _PAUSE

    def explain(self, memory: SimpleNamespace, H: np.ndarray, model: TipModel) -> Event:
        """Says what the step among the last samples looks like, and begins anew."""
        before = 1 + int(_with_step(self._in_sigmas(memory)).argmin())
        error = memory.recent[before:].mean(axis=0) - memory.recent[:before].mean(axis=0)
        whitened = error / np.sqrt(memory.variances)
        by_load = H[:, model.M] / np.sqrt(memory.variances)[:, None]
        change = np.linalg.lstsq(by_load[:, :1], whitened, rcond=None)[0]
        left = whitened - by_load[:, :1] @ change
        self.rest(memory)
        size = float(np.linalg.norm(error[3:]))
        if left @ left < _EXPLAINED * (whitened @ whitened):
            return Event(LOAD_CHANGED, float(change[0] * model.sigma[model.M][0]), size)
        return Event(TOOL_DISPLACED, size, size)


def _share(number: int) -> float:
    """Of so many samples in the running mean."""
    return 1.0 - (1.0 - 1.0 / _WINDOW) ** number


def _with_step(y: np.ndarray) -> np.ndarray:
    """What a step leaves of the squares of rows (n, 6), for each number of rows before it, from one on."""
    sums, before = np.cumsum(y, axis=0), np.arange(1, len(y))[:, None]
    explained = sums[:-1] ** 2 / before + (sums[-1] - sums[:-1]) ** 2 / (len(y) - before)
    return (y * y).sum() - explained.sum(axis=1)[: len(y) - _AFTER]
