"""How far ahead commands have to be: believed, checked with the first motion, and corrected smoothly."""

import math
from types import SimpleNamespace

import numpy as np

from systems.estimation.dead_time import DeadTime, DeadTimeConfig
from systems.estimation.memory import Layout

_RATE = 0.5  # s/s, at most, at which the plan runs ahead or waits while the delay is corrected
_BEND = 10.0  # s/s^2, at most, by which that rate changes
_AGREE = 2e-3  # s, two searches in a row that differ less are believed
_WRONG = 1.5  # periods: what is less is left to the model of the drives
_CLEARER = 4.0  # times: by how much commands have to fit better when they are shifted


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
            memory.settled[0] = planned + self._period
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
        return float(memory.target[0] - target)
