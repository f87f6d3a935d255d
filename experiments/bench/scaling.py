"""What limits a study on many machines: ``python -m experiments.bench.scaling [RUNS]``.

Measured is the processor time that handing out a job takes of the command itself and of a Dask scheduler, and
how the run time of a study falls with the number of processes. A simulation of the scheduler with these costs
says how busy many workers are kept.
"""

import heapq
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import psutil
from rich import box
from rich.console import Console
from rich.table import Table

from experiments.cli.cluster import DaskCluster
from experiments.cli.workers import Executor, LocalProcesses, Progress, in_order
from experiments.study.rows import run_row, study_rows
from experiments.study.study_file import Levels, Study
from robots.threads import usable_cores

EMPTY_JOBS = 2_000
WORKERS = (10, 100, 1_000, 10_000)
JOB_TIMES = (1.0, 5.0, 60.0)  # s
_PORT = 18_787


def main() -> None:
    """Prints the tables; the argument is how many runs the study has, by default 8."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    console = Console()
    local = _per_job(LocalProcesses(1), time.process_time)
    with _cluster() as (cluster, scheduler):
        command = _per_job(cluster, time.process_time)
        handling = _per_job(cluster, lambda: sum(scheduler.cpu_times()[:2]))
    console.print(f"A job takes {1e3 * local:.2f} ms of the command with processes of this machine,")
    console.print(
        f"{1e3 * command:.2f} ms of the command and {1e3 * handling:.2f} ms of the scheduler with Dask."
    )
    console.print(_scaling(runs))
    console.print(_many_workers(max(command, handling)))


def busy_share(workers: int, job_time: float, handling: float, jobs_per_worker: int = 20) -> float:
    """The share of their time that workers work, while one scheduler hands out the jobs.

    It handles one job after the other, ``handling`` seconds each (out, and its result in); a worker has one
    job waiting beside the one it does and asks for the next when it begins one.

    Args:
        workers: their number.
        job_time: of each job in s.
        handling: by the scheduler, of each job in s.
        jobs_per_worker: how long it goes on.
    """
    requests = [(0.0, worker) for worker in range(workers) for _ in range(2)]
    heapq.heapify(requests)
    free = [0.0] * workers  # when each has done all that it was given
    scheduler = 0.0
    for _ in range(workers * jobs_per_worker):
        asked, worker = heapq.heappop(requests)
        scheduler = max(scheduler, asked) + handling
        begins = max(free[worker], scheduler)
        free[worker] = begins + job_time
        heapq.heappush(requests, (begins, worker))
    return workers * jobs_per_worker * job_time / (workers * max(free))


def _per_job(executor: Executor, processor_time: Callable[[], float]) -> float:
    """Seconds of a processor that a job costs beside its work."""
    in_order(executor, _nothing, range(100))  # the processes are there
    spent = []
    for jobs in (EMPTY_JOBS // 4, EMPTY_JOBS):
        start = processor_time()
        in_order(executor, _nothing, range(jobs))
        spent.append(processor_time() - start)
    return (spent[1] - spent[0]) / (EMPTY_JOBS - EMPTY_JOBS // 4)  # without the start of processes


def _nothing(job: int, progress: Progress) -> int:
    return job


def _scaling(runs: int) -> Table:
    """The time of a study over the number of processes."""
    table = Table("processes", "runs", "s", "share of ideal", box=box.SIMPLE_HEAD)
    payloads = Levels([7.0 * i / runs for i in range(runs)])
    rows = study_rows(Study(laws=["open_loop"], quick=True, factors={"station.payload": payloads}))
    alone = 0.0
    for processes in range(1, usable_cores() + 1):
        start = time.perf_counter()
        in_order(LocalProcesses(processes), run_row, rows)
        spent = time.perf_counter() - start
        alone = alone or spent
        table.add_row(str(processes), str(runs), f"{spent:.1f}", f"{alone / (processes * spent):.2f}")
    return table


def _many_workers(handling: float) -> Table:
    """How busy many workers are, by simulation of the scheduler."""
    table = Table("workers", *(f"jobs of {job_time:g} s" for job_time in JOB_TIMES), box=box.SIMPLE_HEAD)
    for workers in WORKERS:
        shares = [busy_share(workers, job_time, handling) for job_time in JOB_TIMES]
        table.add_row(str(workers), *(f"{100.0 * share:.0f} %" for share in shares))
    return table


@contextmanager
def _cluster() -> Iterator[tuple[DaskCluster, psutil.Process]]:
    """A scheduler and a worker over loopback; gives the scheduler's process too."""
    address = f"tcp://127.0.0.1:{_PORT}"
    scheduler = ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(_PORT)]
    worker = ["distributed.cli.dask_worker", address, "--nthreads", "1"]
    processes = [
        subprocess.Popen(
            [sys.executable, "-m", *arguments, "--no-dashboard"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for arguments in (scheduler, worker)
    ]
    try:
        cluster = DaskCluster(address)
        cluster.check()
        yield cluster, psutil.Process(processes[0].pid)
    finally:
        for process in processes:
            process.terminate()
            process.wait()


if __name__ == "__main__":
    main()
