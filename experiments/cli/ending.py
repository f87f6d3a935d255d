"""Ctrl-C and SIGTERM: what ends at once is cleaned up, and what moves a robot is asked to end."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

_TOGETHER = (
    1.0  # s between signals that are one request: a terminal and what started the command send one each
)
_BASE = 128  # exit codes of what a signal has ended, as shells have them


class TerminatedError(KeyboardInterrupt):
    """SIGTERM, which ends a command as Ctrl-C does: by the way that cleans up."""


def exit_code(error: KeyboardInterrupt) -> int:
    """The exit code of a command that was interrupted."""
    return _BASE + (signal.SIGTERM if isinstance(error, TerminatedError) else signal.SIGINT)


def clean_up_on_sigterm() -> None:
    """Makes SIGTERM raise `TerminatedError` in the main thread."""
    signal.signal(signal.SIGTERM, _terminate)


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    raise TerminatedError


class Ending:
    """Whether an end has been asked for."""

    def __init__(self) -> None:
        """Not yet."""
        self.asked = 0.0  # s of the steady clock, when a signal came first
        self.code = 0  # the exit code that belongs to the signal; 0 without one

    def is_asked(self) -> bool:
        """Whether a signal has come."""
        return self.code != 0


@contextmanager
def asking() -> Iterator[Ending]:
    """In this block a first Ctrl-C or SIGTERM only asks; another one later than a second after it interrupts.

    Within that second a robot comes to rest.
    """
    ending = Ending()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def ask(number: int, frame: FrameType | None) -> None:
        if not ending.is_asked():
            ending.code, ending.asked = _BASE + number, time.monotonic()
        elif time.monotonic() - ending.asked > _TOGETHER:
            raise TerminatedError if number == signal.SIGTERM else KeyboardInterrupt

    for number in before:
        signal.signal(number, ask)
    try:
        yield ending
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
