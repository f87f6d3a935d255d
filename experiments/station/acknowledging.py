"""Who lets a robot go on that was stopped for people: the Enter key at the console, or a button's signal."""

import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from systems.link.clock import steady_time

_HOLDS = 0.2  # s, for which it counts: who pressed before the way was free has to press again
_LOOK = 0.2  # s, between two looks whether nobody listens any more


def how() -> str:
    """A line that says how it is done."""
    return f"After a stop for people, Enter or 'kill -USR1 {os.getpid()}' lets the robot go on."


class Acknowledgement:
    """When somebody last let the robot go on."""

    def __init__(self, now: Callable[[], float] = steady_time) -> None:
        """``now``: a clock in s."""
        self._now, self._until = now, -1.0

    def give(self) -> None:
        """Somebody does so now."""
        self._until = self._now() + _HOLDS

    def is_given(self) -> bool:
        """Whether somebody has just done so."""
        return self._now() < self._until


@contextmanager
def acknowledging() -> Iterator[Acknowledgement]:
    """In this block SIGUSR1 and, at a terminal, the Enter key acknowledge."""
    given, ended = Acknowledgement(), threading.Event()

    def heard(number: int, frame: FrameType | None) -> None:
        given.give()

    before = signal.signal(signal.SIGUSR1, heard)
    listener = threading.Thread(target=_listen, args=(given, ended), daemon=True)
    if sys.stdin is not None and sys.stdin.isatty():
        listener.start()
    try:
        yield given
    finally:
        ended.set()
        # Who presses too late must not end what is still to be written, as the signal does by default.
        signal.signal(signal.SIGUSR1, signal.SIG_IGN if before == signal.SIG_DFL else before)
        if listener.ident is not None:
            listener.join()


def _listen(given: Acknowledgement, ended: threading.Event) -> None:
    """Takes lines without Python's buffer, which a thread must not hold when the command ends."""
    while not ended.is_set():
        # A job in the background leaves the terminal to the shell: reading would halt it.
        is_mine = os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
        if not is_mine:
            ended.wait(_LOOK)
        elif select.select([sys.stdin], [], [], _LOOK)[0]:
            if not os.read(sys.stdin.fileno(), 1024):
                return  # the terminal has gone
            given.give()
