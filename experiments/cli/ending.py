"""Ctrl-C and SIGTERM: what ends at once is cleaned up, and what moves a robot is asked to end.

And a stdout that cannot be written: what a command says is lost then, but not its files.
"""

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, NoReturn

_TOGETHER = (
    1.0  # s between signals that are one request: a terminal and what started the command send one each
)
_AGAIN = 0.2  # s, between interrupts of what has swallowed one
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


@contextmanager
def interrupted_once(end_at_once: Callable[[], None]) -> Iterator[None]:
    """In this block a first Ctrl-C or SIGTERM interrupts, and those within a second of it do nothing more.

    They are copies, or an impatient finger, and would break off what cleans up. Later ones hurry it.

    Args:
        end_at_once: hurries it; is called in the main thread while it cleans up.
    """
    if threading.current_thread() is not threading.main_thread():  # only that one may set handlers
        yield
        return
    asked = -math.inf

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        if asked == -math.inf:
            asked = time.monotonic()
            raise TerminatedError if number == signal.SIGTERM else KeyboardInterrupt
        if time.monotonic() - asked > _TOGETHER:
            end_at_once()

    with _handled(interrupt, signal.SIGINT, signal.SIGTERM):
        yield


@contextmanager
def insisting() -> Iterator[None]:
    """In this block Ctrl-C and SIGTERM interrupt, and again every fifth of a second until it is left.

    An optimiser in C++ takes an interrupt as meant for itself: it returns what it has found so far, and the
    work around it would go on.
    """
    if threading.current_thread() is not threading.main_thread():  # only that one may set handlers
        yield
        return
    error: type[KeyboardInterrupt] = KeyboardInterrupt

    def interrupt(number: int, frame: FrameType | None) -> NoReturn:
        nonlocal error
        if number != signal.SIGALRM:
            error = TerminatedError if number == signal.SIGTERM else KeyboardInterrupt
        signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        raise error

    with _handled(interrupt, signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextmanager
def _handled(handler: Callable[[int, FrameType | None], None], *signals: signal.Signals) -> Iterator[None]:
    """In this block a handler has those of these signals that were not ignored."""
    before = {number: signal.getsignal(number) for number in signals}
    for number, former in before.items():
        if former != signal.SIG_IGN:
            signal.signal(number, handler)
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


class _Stdout:
    """A stream that goes nowhere once it cannot be written, as on a full disk; not where a pipe is closed."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.problem = ""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        self._try(self._stream.write, text)
        return len(text)

    def flush(self) -> None:
        self._try(self._stream.flush)

    def _try(self, do: Callable[..., Any], *arguments: Any) -> None:
        try:
            do(*arguments)
        except BrokenPipeError:
            raise
        except OSError as error:
            self.problem = (error.strerror or str(error)).lower()
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())


@contextmanager
def outliving_stdout(code: int) -> Iterator[None]:
    """In this block a stdout that cannot be written stops nothing; afterwards it is said.

    Args:
        code: with which the process ends then, if the block has ended well.
    """
    sys.stdout = stdout = _Stdout(sys.stdout)  # type: ignore[assignment]
    ended: Any = None
    try:
        yield
    except SystemExit as error:
        ended = error.code
    with suppress(BrokenPipeError):
        sys.stdout.flush()
    if stdout.problem:
        print(f"truetip: cannot write to stdout: {stdout.problem}", file=sys.stderr)
    # Nothing is left to be cleaned up: another Ctrl-C ends the interpreter on its way out, without a word.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    sys.exit(ended or (code if stdout.problem else 0))
