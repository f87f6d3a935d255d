"""When this machine wakes, and how late it was: a run may have ended early for want of a processor."""

import math
import os
import time
from pathlib import Path

_SLICE = 8e-4  # s between two looks at the camera
_WATCH = 1e-3  # s after a report was due, until which one looks all the time: who sleeps wakes late and cold
_LATE = 1e-3  # s, above what a wake-up takes
_WORTH_SAYING = 0.01  # s by which this machine was late
_CROWDED = 0.5  # share of the time with processes that wait, above which others may be late, too
_SCHEDULED = Path("/proc/self/schedstat")  # ns on a processor, ns of waiting for one; Linux
_PRESSURE = Path("/proc/pressure/cpu")  # its first line ends with us in which some process waited; Linux
# Its first line: ticks of all processors by use, the eighth stolen by other guests.
_STAT = Path("/proc/stat")


class HostLateness:
    """Counts the messages for which this process was late, and remembers the worst."""

    def __init__(self, keeps_time: bool = True) -> None:
        """Starts to count; who waits does not matter to a run that does not keep the time of the clock."""
        self.messages = self.late = 0
        self.worst = self.worst_at = 0.0  # s
        self._since_message = 0.0  # s, the worst since the last message
        self._waited, self._stolen, self._crowded = _waited(), _stolen(), _crowded()
        self._began = time.monotonic() if keeps_time else math.inf

    def note(self, late: float, at: float, is_message: bool = False) -> None:
        """Counts a message, or a delay.

        Args:
            late: s, by which this process was late.
            at: s, when.
            is_message: whether a message has come with it.
        """
        self._since_message = max(self._since_message, late)
        if is_message:
            self.messages += 1
            self.late += self._since_message > _LATE
            self._since_message = 0.0
        if late > self.worst:
            self.worst, self.worst_at = late, at

    @property
    def waited(self) -> float:
        """How long this process has waited for a processor since the start, in s; 0 where nobody counts."""
        return _waited() - self._waited

    @property
    def stolen(self) -> float:
        """How long processors of this machine were another one's since the start, in s, summed over them."""
        return _stolen() - self._stolen

    def sentence(self, began: float) -> str:
        """In words, with times since ``began`` in s."""
        return (
            f"this machine was late by {1e3 * self.worst:.0f} ms at {max(0.0, self.worst_at - began):.1f} s "
            f"({self.late} of {self.messages} messages late, {self.waited:.1f} s of waiting for a "
            f"processor, {self.stolen:.1f} s stolen by other machines)"
        )

    @property
    def crowding(self) -> float:
        """Share of the time since the start in which some process of this machine waited for a processor.

        The other end of a wire that runs here, too, may be what waits. 0 where nobody counts.
        """
        passed = time.monotonic() - self._began
        return min(1.0, (_crowded() - self._crowded) / passed) if passed > 0.0 else 0.0

    def reason(self, began: float) -> str:
        """What follows why a run ended, with times since ``began`` in s; empty if it was hardly late."""
        own = f"; {self.sentence(began)}" if self.worst > _WORTH_SAYING else ""
        share = self.crowding
        if share < _CROWDED:
            return own
        return f"{own}; processes of this machine waited for a processor {100.0 * share:.0f} % of the time"


def pause_before(now: float, begin: float, expected: float, deadline: float, is_prepared: bool) -> float:
    """How long to sleep at most, in s; not at all between the end of the preparation and the report.

    Args:
        now: s, as all times of one clock.
        begin: when the preparation shall begin.
        expected: when the report is due.
        deadline: until when it is waited for.
        is_prepared: whether all is ready for it.
    """
    if is_prepared and now < expected + _WATCH:
        return 0.0
    longest = begin - now if 0.0 < begin - now < _SLICE else _SLICE
    return min(longest, max(0.0, deadline - now))


def _stolen() -> float:
    try:
        return float(_STAT.read_text().split("\n", 1)[0].split()[8]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return 0.0


def _waited() -> float:
    try:
        return 1e-9 * float(_SCHEDULED.read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return 0.0


def _crowded() -> float:
    try:
        return 1e-6 * float(_PRESSURE.read_text().split("\n", 1)[0].rpartition("=")[2])
    except (OSError, ValueError):
        return 0.0
