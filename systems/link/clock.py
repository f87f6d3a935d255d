"""Mapping of the time stamps of a camera, or of a robot's controller, to the station's clock.

A frame that is exposed at camera time s arrives at station time a = s + offset + drift * s + delay, where
the delay is never below that of an idle line and now and then close to it. So the line below the points
(s, a - s) is the relation of the clocks; what lies above it is jitter. The points are collected in bins of
a second. The drift is the median slope between the second percentiles of the bins (Theil and Sen), which a
quarter of the bins may spoil before it moves; the offset is the median of the bins' smallest delays along
that drift. The percentile is that low because delays have a pattern: a frame that arrives while a controller
is answered waits, and which frames these are shifts slowly with the two periods. At the tenth percentile that
pattern showed as a drift of up to 10 ppm in 20 s, at the second one no longer.

What no clock comparison can see is the smallest delay itself. It is a property of the camera and its line
(`truetip latency` measures it) and is given as ``smallest_delay``.
"""

import math
import time
from collections import deque
from dataclasses import dataclass

import numpy as np

from robots.configuration.quantity import positive, quantity

_FEWEST_FOR_DRIFT = 5  # bins: before, a slope says more of the jitter than of the clocks


@dataclass
class ClockConfig:
    """Parameters of the mapping; read from a scenario file."""

    # From the exposure to its arrival over an idle line
    smallest_delay: float = quantity(0.0, 0.0, unit="s")
    bin_length: float = positive(1.0, "s")  # of station time
    # Bins that are remembered; older ones no longer speak for the present drift
    horizon: int = quantity(60, _FEWEST_FOR_DRIFT)
    # A second of frames this much off shows that a clock was set anew
    step: float = positive(0.02, "s")


@dataclass(frozen=True)
class ClockQuality:
    """Uncertainty of the mapping. ``nan`` where there is too little data yet."""

    frames: int  # since the session began
    span: float  # s of station time behind the estimate
    drift_ppm: float  # the station's clock gains this on the camera's
    drift_sigma_ppm: float
    offset_sigma: float  # s, standard deviation of a mapped stamp, apart from ``smallest_delay``
    jitter: dict[str, float]  # s, delay above the smallest: median, 95 % and 99 % of the remembered frames
    sessions: int  # how often a clock was set anew, the beginning included


_EARLY, _LOW, _JITTER = 2.0, 10.0, (50.0, 95.0, 99.0)  # percentiles
_FEWEST = 20  # frames of a bin: fewer say nothing of an idle line
_SAME_DRIFT = 1e-5  # bins are summed up along the drift known at the time; a change below this leaves them


def steady_time() -> float:
    """The clock of the station, that arrivals are stamped with, in s."""
    return time.perf_counter()


class _Bin:
    """A second of frames, in s since the session began, and what is to be known of it."""

    def __init__(self, stamps: np.ndarray, delays: np.ndarray, drift: float, step: float) -> None:
        self.stamps, self.delays, self._step = stamps, delays, step
        self.stamp = float(np.median(stamps))
        self.sum_up(drift)

    def sum_up(self, drift: float) -> None:
        """Seen along the drift a bin is flat: its percentiles are those of the jitter."""
        self.drift = drift
        level = self.delays - drift * (self.stamps - self.stamp)
        low, *high = np.percentile(level, (_LOW, *_JITTER))
        # Far before the others no frame can come: its stamp is spoiled.
        self.low = float(low)
        sound = level[level > low - self._step]
        self.smallest, self.early = float(sound.min()), float(np.percentile(sound, _EARLY))
        self.excess = [float(value) - self.smallest for value in high]


class StampClock:
    """Estimates offset and drift between the clocks from time stamps and arrival times."""

    def __init__(self, config: ClockConfig | None = None) -> None:
        """Checks the configuration.

        Raises:
            ValueError: if a length of time is not positive, the smallest delay is negative, or the horizon
                is too short for a drift.
        """
        self._config = config or ClockConfig()
        c = self._config
        if not (c.bin_length > 0.0 and c.step > 0.0 and c.smallest_delay >= 0.0):
            raise ValueError(
                "camera clock: bin_length and step must be positive and smallest_delay not negative, got "
                f"{c.bin_length} s, {c.step} s and {c.smallest_delay} s"
            )
        if c.horizon < _FEWEST_FOR_DRIFT:
            raise ValueError(
                f"camera clock: horizon must be {_FEWEST_FOR_DRIFT} bins or more, got {c.horizon}"
            )
        self._sessions = 0
        self.restart()
        self._warm_up()
        self._sessions = 0
        self.restart()

    def _warm_up(self) -> None:
        """Runs through everything once: a first percentile takes 8 ms, which no loop has."""
        between = self._config.bin_length / _FEWEST
        for frame in range(_FEWEST * (_FEWEST_FOR_DRIFT + 1)):
            self.observe(round(1e6 * between * frame), between * frame)

    def restart(self) -> None:
        """Forgets everything: a clock was set anew."""
        self._sessions += 1
        self._frames = 0
        self._origin = 0  # us, the first stamp: floats keep their digits for what comes after
        self._origin_arrival = 0.0
        self._bins: deque[_Bin] = deque(maxlen=self._config.horizon)
        self._stamps: list[float] = []
        self._delays: list[float] = []
        self._opened = 0.0  # s, station time at which the present bin began
        self._drift = 0.0
        self._offset = math.inf
        self._offset_sigma = self._drift_sigma = math.nan

    def observe(self, stamp_us: int, arrival: float) -> None:
        """Takes note of a frame.

        Args:
            stamp_us: the camera's stamp of the exposure.
            arrival: s, station time at which the frame arrived.
        """
        if not self._frames:
            self._origin, self._origin_arrival, self._opened = stamp_us, arrival, arrival
        self._frames += 1
        stamp = self._since_origin(stamp_us)
        delay = (arrival - self._origin_arrival) - stamp
        self._stamps.append(stamp)
        self._delays.append(delay)
        if not self._bins:
            self._offset = min(self._offset, delay)
        if arrival - self._opened >= self._config.bin_length and len(self._delays) >= _FEWEST:
            self._opened = arrival
            self._close_bin()

    def station_time(self, stamp_us: int) -> float:
        """When a frame was exposed, in s on the station's clock; ``nan`` before the first observation."""
        if not self._frames:
            return math.nan
        stamp = self._since_origin(stamp_us)
        mapped = stamp + self._offset + self._drift * stamp
        return self._origin_arrival + mapped - self._config.smallest_delay

    def quality(self) -> ClockQuality:
        """How well the clocks are known now."""
        known = [bin_.excess for bin_ in self._bins]
        jitter = np.median(known, axis=0).tolist() if known else [math.nan] * len(_JITTER)
        return ClockQuality(
            frames=self._frames,
            span=self._bins[-1].stamp - self._bins[0].stamp if self._bins else 0.0,
            drift_ppm=1e6 * self._drift if len(self._bins) >= _FEWEST_FOR_DRIFT else math.nan,
            drift_sigma_ppm=1e6 * self._drift_sigma,
            offset_sigma=self._offset_sigma,
            jitter={f"{level:.0f}%": excess for level, excess in zip(_JITTER, jitter, strict=True)},
            sessions=self._sessions,
        )

    def _since_origin(self, stamp_us: int) -> float:
        return 1e-6 * (stamp_us - self._origin)

    def _close_bin(self) -> None:
        new = _Bin(np.array(self._stamps), np.array(self._delays), self._drift, self._config.step)
        self._stamps, self._delays = [], []
        if self._bins:
            expected = self._offset + self._drift * new.stamp
            # A step makes every frame of a second late. A stall does not: its last frames are in time.
            if max(new.smallest - expected, expected - new.low) > self._config.step:
                self._begin_anew(new.stamps, new.delays)
                return
        self._bins.append(new)
        self._fit()

    def _begin_anew(self, stamps: np.ndarray, delays: np.ndarray) -> None:
        """A new session that begins with the bin that showed the step."""
        stamps_us = self._origin + np.rint(1e6 * stamps).astype(np.int64)
        arrivals = self._origin_arrival + stamps + delays
        self.restart()
        for stamp_us, arrival in zip(stamps_us.tolist(), arrivals.tolist(), strict=True):
            self.observe(stamp_us, arrival)

    def _fit(self) -> None:
        n = len(self._bins)
        if n >= _FEWEST_FOR_DRIFT:
            self._fit_drift()
            outdated = [bin_ for bin_ in self._bins if abs(bin_.drift - self._drift) > _SAME_DRIFT]
            for bin_ in outdated:
                bin_.sum_up(self._drift)
            if outdated:
                self._fit_drift()
        stamp = np.array([bin_.stamp for bin_ in self._bins])
        level = np.array([bin_.smallest for bin_ in self._bins]) - self._drift * stamp
        self._offset = float(np.median(level))
        if n >= _FEWEST_FOR_DRIFT:
            lever = float(stamp[-1] - stamp.mean()) * self._drift_sigma
            own = math.sqrt(math.pi / 2.0 / n) * _robust_sigma(level)  # of a median of n
            self._offset_sigma = math.hypot(own, lever)

    def _fit_drift(self) -> None:
        stamp, early = np.array([(bin_.stamp, bin_.early) for bin_ in self._bins]).T
        first, second = np.triu_indices(len(stamp), 1)
        self._drift = float(np.median((early[second] - early[first]) / (stamp[second] - stamp[first])))
        scatter = _robust_sigma(early - self._drift * stamp)
        # Of a slope through n points; Theil and Sen's has 91 % of the efficiency of least squares.
        self._drift_sigma = scatter / (math.sqrt(0.91 * len(stamp)) * float(stamp.std()))


def _robust_sigma(values: np.ndarray) -> float:
    """Standard deviation from the median of the distances to the median."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))
