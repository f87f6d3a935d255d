"""Work that compiled loops and numpy do in several threads of a process, as many as somebody allows."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

Result = TypeVar("Result")

_AT_MOST: ContextVar[int | None] = ContextVar("at_most", default=None)


@contextmanager
def at_most(threads: int | None) -> Iterator[None]:
    """Lets `side_by_side` take so many threads within this block; None for one per core of the process."""
    token = _AT_MOST.set(threads)
    try:
        yield
    finally:
        _AT_MOST.reset(token)


def take_one_thread() -> None:
    """Lets `side_by_side` take one thread from now on, as in a process that is one of many."""
    _AT_MOST.set(1)


def allowed() -> int:
    """How many threads `side_by_side` takes here."""
    return _AT_MOST.get() or usable_cores()


def side_by_side(work: Callable[..., Result], *cases: Iterable[Any]) -> list[Result]:
    """What `map` gives, in threads: compiled loops and numpy let other threads go on meanwhile.

    Args:
        work: spends its time in these, and changes nothing that another case reads.
        cases: its arguments.
    """
    if allowed() == 1:
        return list(map(work, *cases))
    with ThreadPoolExecutor(allowed()) as threads:
        return list(threads.map(work, *cases))


def usable_cores() -> int:
    """The number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
