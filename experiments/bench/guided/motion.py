"""What a fault on the wire moves: ``python -m experiments.bench.guided.motion [WORDS]``.

A client guides a virtual cell over loopback along circles, in three processes, with a law that sends
positions and with one that sends speeds alone. At a set time clocks are set, messages are lost, a joint is
measured elsewhere, or the controller's program ends. For each case the table says how the client ended and
how near the robot came to its limits of speed and acceleration, in the commands of the record and in the true
motion of the links, whose gears and arms swing. It takes about twelve minutes, in real time; words choose
cases: ``clock pbvs``.
"""

import sys
import tempfile
import time
from itertools import product
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from experiments.bench.guided.three_processes import CIRCLE, Outcome, ThreeProcesses
from experiments.cli.console import progress_bar

LAWS = ("numerical_ik", "pbvs")
FAULTS = {
    "clock 1 s ahead": "clock_step_at={at}",
    "clock 3 s back": "clock_step_at={at},clock_step=-3",
    "silent 0.05 s": "stall_at={at},stall_for=0.05",
    "silent 0.3 s": "stall_at={at},stall_for=0.3",
    "silent 1 s": "stall_at={at},stall_for=1",
    "joint jumps 20 deg": "joint_jump_at={at}",
    "program ends": "stop_at={at}",
    "bad network": "loss=0.05,reordering=0.05,duplication=0.05,jitter=0.004,burst=0.005,burst_length=5",
}
_AT = 30.0  # s of the cell's time, in which the client has come to its path
_AFTER = 6.0  # s that are watched
_PATH = (*CIRCLE, "reference.laps=40")


def run_case(folder: Path, fault: str, law: str) -> Outcome:
    """One fault; the robot is led on where it may be. Raises RuntimeError if the fault comes too soon."""
    faults = FAULTS[fault].format(at=_AT)
    with ThreeProcesses(folder, _PATH, resumes=True, law=law, faults=faults) as three:
        began = time.monotonic()
        three.wait_for_path()
        if time.monotonic() - began > _AT:
            raise RuntimeError(f"not on its path within {_AT:g} s")
        time.sleep(_AT + _AFTER - (time.monotonic() - began))
        said = (
            three.client_end() if three.has_ended("client") else f"on its path; {three.stopped_client_end()}"
        )
        time.sleep(2.0)
        three.end("cell")
    return three.outcome(said)


def main(chosen: list[str]) -> None:
    """Runs the cases whose words are all among the arguments, or all of them, and prints the table."""
    cases = [case for case in product(FAULTS, LAWS) if set(chosen) <= set(" ".join(case).split())]
    table = Table(box=box.SIMPLE_HEAD)
    for name in ("fault", "law", "after it", "commands", "links", "at rest"):
        table.add_column(name, overflow="fold")
    with progress_bar(f"{len(cases)} cases in real time") as progress:
        for number, case in enumerate(cases):
            with tempfile.TemporaryDirectory(prefix="truetip-motion-") as folder:
                try:
                    table.add_row(*case, *run_case(Path(folder), *case).cells())
                except RuntimeError as error:
                    table.add_row(*case, str(error))
            progress((number + 1) / len(cases))
    Console(width=None if sys.stdout.isatty() else 160).print(table)
    print("commands and links: largest shares of the limits of speed / acceleration")


if __name__ == "__main__":
    main(sys.argv[1:])
