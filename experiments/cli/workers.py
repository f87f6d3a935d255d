"""Distributes work over the processes of this machine, with progress and a clean end on Ctrl-C."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from dataclasses import dataclass
from multiprocessing.connection import wait as wait_for
from typing import Any, Protocol, TypeVar

from experiments.cli.ending import interrupted_once
from experiments.cli.one_thread import ONE_THREAD
from robots.threads import take_one_thread, usable_cores

_POLL = 0.1  # s between two looks at the progress
_AHEAD = 4  # jobs per process that wait in its queue: enough that none is idle, few enough to hold in memory

Job = TypeVar("Job")
Result = TypeVar("Result")
Progress = Callable[[float], None]


class SimulationError(RuntimeError):
    """A run was aborted, for example because the integrator failed."""


class Executor(Protocol):
    """Does jobs somewhere: in processes of this machine, or on a cluster."""

    def place(self, jobs: int) -> str:
        """Where that many jobs would be done, for people: "in 2 processes"."""
        ...

    def completed(
        self,
        work: Callable[[Job, Progress], Result],
        jobs: Sequence[Job],
        progress: Progress | None = None,
    ) -> Generator[tuple[int, Result], None, None]:
        """Does all jobs and gives number and result of each as soon as it is done.

        Close it (`contextlib.closing`) where not all results are taken.

        Args:
            work: what to do with a job; a function of a module, for it is sent to other processes. It is
                given a function to call now and then with the share that is done.
            jobs: they travel to other processes too; the first ones are begun first.
            progress: is called now and then with the share of everything that is done, 0 to 1.

        Raises:
            SimulationError: if what does the jobs is lost; also whatever a job raises.
            KeyboardInterrupt: if the user stopped it; no process is left behind.
        """
        ...


@dataclass(frozen=True)
class LocalProcesses:
    """An `Executor` of processes of this machine; ``count`` None for one per core."""

    count: int | None = None

    def place(self, jobs: int) -> str:
        """See `Executor`."""
        processes = self._processes(jobs)
        return f"in {processes} process{'es' if processes > 1 else ''}"

    def completed(
        self,
        work: Callable[[Job, Progress], Result],
        jobs: Sequence[Job],
        progress: Progress | None = None,
    ) -> Generator[tuple[int, Result], None, None]:
        """See `Executor`."""
        processes = self._processes(len(jobs))
        # Spawned processes load numpy anew, so the settings of the environment reach them.
        context = multiprocessing.get_context("spawn")
        shares = context.Array("d", len(jobs), lock=False)
        stop = context.Event()
        with _environment(dict.fromkeys(ONE_THREAD, "1")), interrupted_once(_end_workers):
            pool = ProcessPoolExecutor(processes, context, _start_worker, (shares, stop))
            waiting: dict[Future[Result], int] = {}
            upcoming = iter(enumerate(jobs))
            try:
                while True:
                    with _sigint_ignored():
                        while len(waiting) < _AHEAD * processes and (job := next(upcoming, None)):
                            waiting[pool.submit(_do, work, *job)] = job[0]
                    if not waiting:
                        return
                    done, _ = wait(waiting, timeout=_POLL, return_when=FIRST_COMPLETED)
                    for future in done:
                        yield waiting.pop(future), future.result()
                    if progress:
                        progress(sum(shares) / len(shares))
            except BrokenProcessPool as error:
                raise SimulationError(
                    "a worker process was ended from outside, ran out of memory, or could not import the "
                    'script, a file that calls this below `if __name__ == "__main__":`'
                ) from error
            finally:
                stop.set()
                pool.shutdown(wait=True, cancel_futures=True)

    def _processes(self, jobs: int) -> int:
        return max(1, min(self.count or usable_cores(), jobs))


def in_order(
    executor: Executor,
    work: Callable[[Job, Progress], Result],
    jobs: Sequence[Job],
    progress: Progress | None = None,
) -> list[Result]:
    """The results of all jobs in the order of the jobs; see `Executor.completed`."""
    with closing(executor.completed(work, jobs, progress)) as completed:
        results = dict(completed)
    return [results[number] for number in range(len(jobs))]


def in_processes(
    work: Callable[[Job, Progress], Result],
    jobs: Sequence[Job],
    processes: int | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """The same in processes of this machine, one per core unless their number is given."""
    return in_order(LocalProcesses(processes), work, jobs, progress)


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


def _end_workers() -> None:
    """Ends the processes at once; a pool whose processes are gone closes by itself."""
    for process in multiprocessing.active_children():
        process.terminate()


class _StoppedError(Exception):
    """The parent process does not want the result any more."""


_worker: dict[str, Any] = {}  # what a worker process shares with its parent


def _start_worker(shares: Any, stop: Any) -> None:
    _worker.update(shares=shares, stop=stop)
    take_one_thread()  # the cores are full of processes
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Nobody waits for the results of an orphan."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait_for([parent.sentinel])
        os._exit(1)


def _do(work: Callable[[Any, Progress], Any], number: int, job: Any) -> Any:
    def progress(share: float) -> None:
        _worker["shares"][number] = share
        if _worker["stop"].is_set():
            raise _StoppedError

    return work(job, progress)
