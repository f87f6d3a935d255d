"""What a law's update costs: wall time of each, taken around it without the law's knowing."""

import time
from typing import Any

import numpy as np
from pydrake.systems.framework import System


class _Timed:
    """Stands before a law in the order of its bases and times the updates that it declares."""

    tick_seconds: list[float]

    def DeclarePeriodicDiscreteUpdateEvent(  # noqa: N802  the name that Drake gives it
        self, period_sec: float, offset_sec: float, update: Any
    ) -> Any:
        """Declares an update that is timed."""
        seconds = self.__dict__.setdefault("tick_seconds", [])

        def timed(context, discrete_state):
            started = time.perf_counter()
            status = update(context, discrete_state)
            seconds.append(time.perf_counter() - started)
            return status

        declare: Any = super()
        return declare.DeclarePeriodicDiscreteUpdateEvent(period_sec, offset_sec, timed)


def timed(law: type[System]) -> type[System]:
    """A law whose updates are timed; otherwise it is the same. For a diagram there is nothing to time."""
    return type(law.__name__, (_Timed, law), {"__doc__": law.__doc__, "__module__": law.__module__})


def tick_seconds(law: System) -> np.ndarray:
    """Wall time of every update of a law in s, in order; empty if it was not made by `timed`."""
    return np.array(getattr(law, "tick_seconds", []))
