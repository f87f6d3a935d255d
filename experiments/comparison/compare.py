"""All laws on one scenario, each in several cycles, on as many processes as there are cores."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from diagrams.record.log import RunLog
from diagrams.runs.simulation import run
from diagrams.scenario.scenario import Scenario
from experiments.cli.workers import Progress, SimulationError, in_processes
from robots.description.model import RobotModel

# The longest job comes first, so that no core waits for it at the end.
SLOWEST_FIRST = ("pbvs", "position_level", "numerical_ik", "open_loop")


@dataclass(frozen=True)
class RunJob:
    """One cycle of one law."""

    scenario: Scenario
    robot: RobotModel
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
        robot: the robot as the controller knows it.
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
    jobs = [
        RunJob(scenario, robot, law, scenario.seed + cycle)
        for law in sorted(laws, key=_slowness)
        for cycle in range(cycles)
    ]
    results = in_processes(run_job, jobs, processes, progress)
    logs = {(job.law, job.seed): log for job, log in zip(jobs, results, strict=True)}
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


def run_job(job: RunJob, progress: Progress) -> RunLog:
    """Runs one cycle. Raises what `simulating` raises."""
    with simulating(job.law, job.seed):
        return run(job.scenario, job.law, job.robot, job.seed, progress)


def _slowness(law: str) -> int:
    return SLOWEST_FIRST.index(law) if law in SLOWEST_FIRST else -1
