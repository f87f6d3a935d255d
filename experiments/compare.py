"""All laws on one scenario, each in several cycles, on as many processes as there are cores."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from diagrams.log import RunLog
from diagrams.run import run
from diagrams.scenario import Scenario
from robots.model import RobotModel

# The longest job comes first, so that no core waits for it at the end.
SLOWEST_FIRST = ("pbvs", "position_level", "numerical_ik", "open_loop")
_POLL = 0.1  # s between two looks at the progress
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class SimulationError(RuntimeError):
    """A run broke off, for example because the integrator could not go on."""


@dataclass(frozen=True)
class Job:
    """One cycle of one law."""

    number: int
    law: str
    seed: int


def compare(
    scenario: Scenario,
    robot: RobotModel,
    laws: Sequence[str],
    cycles: int = 1,
    processes: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> dict[str, list[RunLog]]:
    """Runs every law ``cycles`` times, with the scenario's seed and the ones after it.

    The result does not depend on the number of processes.

    Args:
        scenario: what to do.
        robot: the nominal robot.
        laws: which laws, in the order of the result.
        cycles: runs of each law, at least 1.
        processes: how many run at a time; None for one per core.
        progress: is called now and then with the share that is done, 0 to 1.

    Returns:
        The logs of the cycles of each law.

    Raises:
        SimulationError: if a run broke off.
        KeyboardInterrupt: if the user stopped it; no process is left behind.
    """
    pairs = [(law, scenario.seed + cycle) for law in sorted(laws, key=_slowness) for cycle in range(cycles)]
    jobs = [Job(number, law, seed) for number, (law, seed) in enumerate(pairs)]
    processes = min(processes or usable_cores(), len(jobs))
    # Spawned processes load numpy anew, so the settings of the environment reach them.
    context = multiprocessing.get_context("spawn")
    shares = context.Array("d", len(jobs), lock=False)
    stop = context.Event()
    with _environment(dict.fromkeys(_ONE_THREAD, "1")):
        pool = ProcessPoolExecutor(processes, context, _start_worker, (shares, stop))
        try:
            with _sigint_ignored():
                futures = {pool.submit(_run_job, scenario, robot, job): job for job in jobs}
            _watch(futures, shares, progress)
            logs = {(job.law, job.seed): future.result() for future, job in futures.items()}
        except BrokenProcessPool as error:
            raise SimulationError("a worker process was ended from outside, or ran out of memory") from error
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
    return {law: [logs[law, scenario.seed + cycle] for cycle in range(cycles)] for law in laws}


@contextmanager
def simulating(law: str, seed: int) -> Iterator[None]:
    """Says which run it was, if the simulation in this block breaks off.

    Raises:
        SimulationError: in place of Drake's RuntimeError; one line.
    """
    try:
        yield
    except RuntimeError as error:
        raise SimulationError(f"law {law}, seed {seed}: {' '.join(str(error).split())}") from error


def usable_cores() -> int:
    """The number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _slowness(law: str) -> int:
    return SLOWEST_FIRST.index(law) if law in SLOWEST_FIRST else -1


def _watch(futures: dict[Future, Job], shares: Any, progress: Callable[[float], None] | None) -> None:
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


def _run_job(scenario: Scenario, robot: RobotModel, job: Job) -> RunLog:
    def progress(share: float) -> None:
        _worker["shares"][job.number] = share
        if _worker["stop"].is_set():
            raise _StoppedError

    with simulating(job.law, job.seed):
        return run(scenario, job.law, robot, job.seed, progress)
