"""What a law's update costs: wall time of each, taken around it without the law's knowing."""

import time
from array import array
from typing import Any

import numpy as np
from pydrake.systems.framework import System


class TickClock:
    """Times the updates of one law.

    The times are no state: in the context they would make two runs of the same seed differ. The law does not
    have them either, its updates are handed to Drake through the clock.
    """

    def __init__(self) -> None:
        """Has timed nothing."""
        self._seconds = array("f")  # of hours of ticks, in which a millisecond is known to a nanosecond
        self._is_stopped = False

    @property
    def seconds(self) -> np.ndarray:
        """Wall time of every update so far in s, or since `forget`, in order."""
        return np.array(self._seconds, dtype=float)

    def forget(self) -> None:
        """Begins anew, so that memory stays flat over hours."""
        del self._seconds[:]

    def stop(self) -> None:
        """Times nothing any more."""
        self._is_stopped = True

    def timed(self, law: type[System]) -> type[System]:
        """A law whose updates are timed; otherwise it is the same. For a diagram there is nothing to time."""
        taken = self._seconds.append

        def declare(system: Any, period_sec: float, offset_sec: float, update: Any) -> Any:
            def timed_update(context, discrete_state):
                started = time.perf_counter()
                status = update(context, discrete_state)
                if not self._is_stopped:
                    taken(time.perf_counter() - started)
                return status

            declare_untimed = super(kind, system).DeclarePeriodicDiscreteUpdateEvent
            return declare_untimed(period_sec, offset_sec, timed_update)

        members = {"__doc__": law.__doc__, "__module__": law.__module__}
        kind: Any = type(law.__name__, (law,), members | {"DeclarePeriodicDiscreteUpdateEvent": declare})
        return kind
