"""Distributes work over processes, with progress and a clean end on Ctrl-C."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

_POLL = 0.1  # s between two looks at the progress
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")

Job = TypeVar("Job")
Result = TypeVar("Result")
Progress = Callable[[float], None]


class SimulationError(RuntimeError):
    """A run was aborted, for example because the integrator failed."""


def in_processes(
    work: Callable[[Job, Progress], Result],
    jobs: Sequence[Job],
    processes: int | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Does all jobs, the first ones first.

    Args:
        work: what to do with a job; a function of a module, for it is sent to other processes. It is given a
            function to call now and then with the share that is done.
        jobs: at least one; they travel to other processes too.
        processes: how many work at a time; None for one per core.
        progress: is called now and then with the share of everything that is done, 0 to 1.

    Returns:
        The results in the order of the jobs.

    Raises:
        SimulationError: if a process was ended from outside; also whatever a job raises.
        KeyboardInterrupt: if the user stopped it; no process is left behind.
    """
    processes = min(processes or usable_cores(), len(jobs))
    # Spawned processes load numpy anew, so the settings of the environment reach them.
    context = multiprocessing.get_context("spawn")
    shares = context.Array("d", len(jobs), lock=False)
    stop = context.Event()
    with _environment(dict.fromkeys(_ONE_THREAD, "1")):
        pool = ProcessPoolExecutor(processes, context, _start_worker, (shares, stop))
        try:
            with _sigint_ignored():
                futures = [pool.submit(_do, work, number, job) for number, job in enumerate(jobs)]
            _watch(futures, shares, progress)
            return [future.result() for future in futures]
        except BrokenProcessPool as error:
            raise SimulationError("a worker process was ended from outside, or ran out of memory") from error
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)


def usable_cores() -> int:
    """The number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _watch(futures: Sequence[Future], shares: Any, progress: Progress | None) -> None:
    """Waits for all jobs, or for the first that fails."""
    waiting = set(futures)
    while waiting:
        done, waiting = wait(waiting, timeout=_POLL, return_when=FIRST_COMPLETED)
        for future in done:
            future.result()
        if progress:
            progress(sum(shares) / len(shares))


@contextmanager
def _environment(changes: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _sigint_ignored() -> Iterator[None]:
    """Processes started in this block ignore Ctrl-C, which reaches all of a terminal: this one decides."""
    if threading.current_thread() is not threading.main_thread():  # only that one may set handlers
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


class _StoppedError(Exception):
    """The parent process does not want the result any more."""


_worker: dict[str, Any] = {}  # what a worker process shares with its parent


def _start_worker(shares: Any, stop: Any) -> None:
    _worker.update(shares=shares, stop=stop)


def _do(work: Callable[[Any, Progress], Any], number: int, job: Any) -> Any:
    def progress(share: float) -> None:
        _worker["shares"][number] = share
        if _worker["stop"].is_set():
            raise _StoppedError

    return work(job, progress)
