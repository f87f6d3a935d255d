"""All laws on one scenario, each in several cycles, on as many processes as there are cores."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from diagrams.record.log import RunLog
from diagrams.runs.simulation import run
from diagrams.scenario.scenario import Scenario
from experiments.cli.workers import Executor, LocalProcesses, Progress, SimulationError, in_order
from robots.description.model import RobotModel
from systems.named_classes import place_in_own_file
from systems.servo import LAWS
from systems.servo.contract import law_traits


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
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> dict[str, list[RunLog]]:
    """Runs every law ``cycles`` times, with the scenario's seed and the ones after it.

    The result does not depend on where they run.

    Args:
        scenario: what to do.
        robot: the robot as the controller knows it.
        laws: which laws, in the order of the result.
        cycles: runs of each law, at least 1.
        executor: where they run; by default in one process per core.
        progress: is called now and then with the share that is done, 0 to 1.

    Returns:
        The logs of the cycles of each law.

    Raises:
        SimulationError: if a run broke off.
        KeyboardInterrupt: if the user stopped it; no process is left behind.
    """
    jobs = [
        RunJob(scenario, robot, law, scenario.seed + cycle)
        for law in sorted(laws, key=_is_quick)
        for cycle in range(cycles)
    ]
    results = in_order(executor or LocalProcesses(), run_job, jobs, progress)
    logs = {(job.law, job.seed): log for job, log in zip(jobs, results, strict=True)}
    return {law: [logs[law, scenario.seed + cycle] for cycle in range(cycles)] for law in laws}


@contextmanager
def simulating(law: str, seed: int) -> Iterator[None]:
    """Says which run it was, if the simulation in this block breaks off.

    Raises:
        SimulationError: in place of Drake's RuntimeError, or of whatever a file of one's own raises; one
            line.
    """
    try:
        yield
    except (Exception, SystemExit) as error:  # a law of one's own may raise anything
        told = place_in_own_file(error)
        if told is None and isinstance(error, SystemExit):  # Drake's own checks raise it
            told = f"SystemExit: {error}"
        if told is None and not isinstance(error, RuntimeError):
            raise
        raise SimulationError(f"law {law}, seed {seed}: {' '.join((told or str(error)).split())}") from error


def run_job(job: RunJob, progress: Progress) -> RunLog:
    """Runs one cycle. Raises what `simulating` raises."""
    with simulating(job.law, job.seed):
        return run(job.scenario, job.law, job.robot, job.seed, progress)


def compared_laws() -> list[str]:
    """The laws that are compared unless others are named."""
    return [name for name, law in LAWS.items() if law_traits(law).is_compared]


def named_laws(text: str | None) -> list[str]:
    """The laws in a text such as ``"open_loop,my_law.py:MyLaw"``; None stands for `compared_laws`.

    Raises:
        ValueError: if one is unknown or named twice.
    """
    if text is None:
        return compared_laws()
    laws = [law.strip() for law in text.split(",")]
    for law in laws:
        LAWS.find(law)
        if laws.count(law) > 1:
            raise ValueError(f"--laws: '{law}' is there twice")
    return laws


def _is_quick(law: str) -> bool:
    """Laws without a camera take less time; the longest jobs come first, so that no core waits at the end."""
    return not law_traits(LAWS.find(law)).uses_camera
