"""Distributes work over a Dask cluster: any scheduler that is reached by its address."""

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from experiments.cli.workers import Executor, Job, LocalProcesses, Progress, Result, SimulationError

_AHEAD = 4  # jobs per thread of a worker that are sent ahead, so that none waits for the network
_PATIENCE = 10.0  # s for the scheduler to answer, and for its first worker


def executor(scheduler: str | None, processes: int | None = None) -> Executor:
    """Where ``--scheduler`` and ``--jobs`` want the work done.

    Raises:
        ValueError: if both are given, or the scheduler cannot be used; one line that says why.
    """
    if scheduler is None:
        return LocalProcesses(processes)
    if processes is not None:
        raise ValueError("--jobs: the workers of --scheduler decide how many jobs run at a time")
    cluster = DaskCluster(scheduler)
    cluster.check()
    return cluster


@dataclass(frozen=True)
class DaskCluster:
    """An `Executor` behind a scheduler of `dask.distributed`.

    A job whose worker is lost is done again by another one. Workers need truetip of the same version; one
    thread each (``dask worker --nthreads 1``), because a simulation keeps its interpreter busy.
    """

    address: str  # such as tcp://host:8786

    def place(self, jobs: int) -> str:
        """See `Executor`."""
        return f"on {self.address}"

    def check(self) -> None:
        """Reaches the scheduler once.

        Raises:
            ValueError: if it does not answer, has no worker, or a worker has no truetip of this version.
        """
        with closing(self._client()) as client:
            try:
                client.wait_for_workers(1, timeout=_PATIENCE)
            except TimeoutError as error:
                raise ValueError(f"--scheduler: {self.address} has no worker") from error
            for worker, found in client.run(_version, on_error="return").items():
                if isinstance(found, BaseException):
                    raise ValueError(f"--scheduler: worker {worker} cannot load truetip: {found}")
                if found != _version():
                    raise ValueError(
                        f"--scheduler: worker {worker} has truetip {found}, here it is {_version()}"
                    )

    def completed(
        self,
        work: Callable[[Job, Progress], Result],
        jobs: Sequence[Job],
        progress: Progress | None = None,
    ) -> Generator[tuple[int, Result], None, None]:
        """See `Executor`."""
        from distributed import as_completed
        from distributed.client import FutureCancelledError
        from distributed.scheduler import KilledWorker

        with closing(self._client()) as client:
            upcoming, waiting, done = iter(enumerate(jobs)), {}, 0
            queue = as_completed(loop=client.loop)
            try:
                while True:
                    room = _AHEAD * max(1, sum(client.nthreads().values()))
                    while len(waiting) < room and (job := next(upcoming, None)):
                        future = client.submit(_do, work, job[1], pure=False)
                        waiting[future.key] = job[0]
                        queue.add(future)
                    if not waiting:
                        return
                    future = next(queue)
                    result = future.result()
                    yield waiting.pop(future.key), result
                    future.release()
                    done += 1
                    if progress:
                        progress(done / len(jobs))
            except KilledWorker as error:
                raise SimulationError(f"a job ended its worker again and again: {error}") from error
            except (FutureCancelledError, OSError) as error:
                raise SimulationError(f"the scheduler {self.address} was lost: {error}") from error

    def _client(self) -> Any:
        try:
            from distributed import Client
            from distributed.comm.addressing import resolve_address
        except ModuleNotFoundError as error:
            raise ValueError("--scheduler: needs dask: pip install 'truetip[cluster]'") from error
        try:
            resolve_address(self.address)  # a client of an address that is none waits 20 s for its own end
            return Client(self.address, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            reason = " ".join(str(error).split())
            raise ValueError(f"--scheduler: no Dask scheduler at {self.address}: {reason}") from error


def _do(work: Callable[[Job, Progress], Result], job: Job) -> Result:
    return work(job, _unheard)


def _unheard(_share: float) -> None:
    """Workers of a cluster tell no more than that a job is done."""


def _version() -> str:
    """Of truetip on the machine that asks."""
    try:
        return version("truetip")
    except PackageNotFoundError:
        return "not installed"
