"""How long motors take to do what they are told, by their encoders, and how far ahead commands have to be."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from robots.configuration.quantity import positive, quantity
from systems.estimation import kernels
from systems.estimation.kernels.arrays import Ring
from systems.estimation.memory import History, Layout

_RATE = 0.5  # s/s, at most, at which the plan runs ahead or waits while the delay is corrected
_BEND = 10.0  # s/s^2, at most, by which that rate changes
_AGREE = 2e-3  # s, two searches in a row that differ less are believed
_WRONG = 1.5  # periods: what is less is left to the model of the drives
_CLEARER = 4.0  # times: by how much commands have to fit better when they are shifted


@dataclass
class DeadTimeConfig:
    """What the search allows."""

    longest: float = positive(0.32, "s")  # from a command to its motion
    window: float = positive(0.4, "s")  # of encoders that are compared while nothing is known
    short_window: float = positive(0.1, "s")  # the same while the robot works
    # Of the joint that moves most in the window: less shows nothing
    excitation: float = positive(1e-3, "rad")
    residual: float = quantity(0.05, 0.0, 1.0)  # share of the motion that may be left at the best shift


class Lateness(NamedTuple):
    """What a search has found."""

    delay: float  # s, from a command to its motion
    residual: float  # share of the motion that is left at this delay, 0 to 1
    residual_believed: float  # the same at the delay that is believed


class DeadTime:
    """The shift in time at which commanded and measured positions of the joints differ least.

    Commands are kept with the times at which they were sent, so that the delay is found whatever plan they
    were made from. The best shift is that of the parabola through the smallest sum of squares and its
    neighbours.
    """

    def __init__(self, period: float, config: DeadTimeConfig) -> None:
        """Lays out the memory: what was commanded, and what encoders said.

        Raises:
            ValueError: if a window or the longest delay is not positive, or the short window the longer one.
        """
        if not (config.window >= config.short_window > 0.0 and config.longest > 0.0):
            raise ValueError(
                "dead time: window and longest must be positive and short_window not above window, got "
                f"{config.window} s, {config.longest} s and {config.short_window} s"
            )
        self._period, self._config = period, config
        self._window, self._short = round(config.window / period), round(config.short_window / period)
        self._longest = round(config.longest / period)
        length = self._window + self._longest + 8
        self._commanded, self._measured = History(6, length), History(6, self._window + 8)
        self.layout = Layout(commanded=self._commanded.layout, measured=self._measured.layout)

    def command(self, memory: SimpleNamespace, time: float, theta: np.ndarray) -> None:
        """Takes note of what is commanded at a time, rad, (6,)."""
        self._commanded.append(memory.commanded, time, theta)

    def measure(self, memory: SimpleNamespace, time: float, theta: np.ndarray) -> None:
        """Takes note of where the motors were."""
        self._measured.append(memory.measured, time, theta)

    def search(self, memory: SimpleNamespace, believed: float, is_working: bool = False) -> Lateness | None:
        """Compares; None while the window is not full, or the joints did not move enough to tell.

        Args:
            memory: of the layout.
            believed: the delay in s that the best one is compared with.
            is_working: take the short window, and positions as they are. Otherwise they are compared less
                their means, so that offsets do not matter, but neither does a delay at constant speed.
        """
        measured, commanded = memory.measured, memory.commanded
        n = self._short if is_working else self._window
        if measured.count[0] < n or commanded.count[0] < 2:
            return None
        rings = (Ring(part.count, part.times, part.rows) for part in (measured, commanded))
        squares, least = np.empty(self._longest + 1), self._config.excitation
        if not kernels.dead_time.misfits(*rings, n, self._period, is_working, least, squares):
            return None
        best = int(np.argmin(squares))
        fine = 0.0
        if 0 < best < len(squares) - 1:
            before, here, behind = squares[best - 1 : best + 2]
            bend = before - 2.0 * here + behind
            fine = 0.5 * (before - behind) / bend if bend > 0.0 else 0.0
        place = min(max(round(believed / self._period), 0), len(squares) - 1)
        return Lateness((best + fine) * self._period, float(squares[best]), float(squares[place]))

    def rehearse(self, memory: SimpleNamespace) -> None:
        """Has everything compiled that `search` needs, on memory that nobody uses."""
        for k in range(self._window):
            self.command(memory, k * self._period, np.zeros(6))
            self.measure(memory, k * self._period, np.zeros(6))
        self.search(memory, 0.0)

    def found(self, lateness: Lateness | None) -> bool:
        """Whether the encoders are delayed commands and nothing else."""
        return lateness is not None and lateness.residual < self._config.residual


class CommandDelay:
    """The delay from a command to its motion that the plan counts on."""

    def __init__(self, period: float, config: DeadTimeConfig) -> None:
        """Builds the search."""
        self._period = period
        self.search = DeadTime(period, config)
        self.layout = Layout(
            search=self.search.layout,
            delay=(1,),
            rate=(1,),  # of the delay while it is corrected
            target=(1,),
            known=(1,),
            last=(1,),  # what the last search found in s, NaN if it found nothing
            settled=(1,),  # the planned instant up to which the delay was wrong
        )

    def start(self, memory: SimpleNamespace, delay: float) -> None:
        """Begins with what is believed, in s."""
        memory.delay[0] = memory.target[0] = delay
        memory.known[0], memory.last[0], memory.settled[0] = 0.0, np.nan, -np.inf

    def step(self, memory: SimpleNamespace, planned: float) -> float:
        """The delay for this tick in s; ``planned`` is the instant that was planned last, in s."""
        way = float(memory.target[0] - memory.delay[0])
        if way != 0.0:
            most = _BEND * self._period
            # As fast as it can still be stopped from in whole periods.
            stopping = math.sqrt(0.25 * most**2 + 2.0 * _BEND * abs(way)) - 0.5 * most
            fastest = min(_RATE, stopping, abs(way) / self._period)
            wanted = math.copysign(fastest, way)
            rate = float(memory.rate[0])
            rate += min(max(wanted - rate, -most), most)
            memory.delay[0] += rate * self._period
            memory.rate[0] = rate
            if abs(memory.target[0] - memory.delay[0]) < 1e-6:
                memory.delay[0], memory.rate[0] = memory.target[0], 0.0
            # The instant of this tick, a little further on for rounding.
            memory.settled[0] = planned + (1.0 + max(0.0, rate) + 1e-6) * self._period
        return float(memory.delay[0])

    def is_settled(self, memory: SimpleNamespace, instant: float) -> bool:
        """Whether motors should be where they were planned to be at an instant."""
        return bool(memory.known[0] and instant > memory.settled[0])

    def look(self, memory: SimpleNamespace) -> float:
        """Searches; returns by how much the delay is corrected from now on in s, 0 if it is not."""
        target = float(memory.target[0])
        found = self.search.search(memory.search, target, is_working=bool(memory.known[0]))
        if found is None or not self.search.found(found):
            memory.last[0] = np.nan
            return 0.0
        agrees = abs(found.delay - memory.last[0]) < _AGREE
        memory.last[0] = found.delay
        if not agrees:
            return 0.0
        memory.known[0] = 1.0
        is_clear = found.residual_believed > _CLEARER * found.residual
        if abs(found.delay - target) < _WRONG * self._period or not is_clear:
            return 0.0
        memory.target[0] = max(self._period, found.delay)
        memory.settled[0] = np.inf  # until the next command: nothing that was planned so far was in time
        return float(memory.target[0] - target)
