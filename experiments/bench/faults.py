"""What happens when a process of the cell stands still or dies: ``python -m experiments.bench.faults``.

A client guides a virtual cell over loopback, its camera behind a relay, three processes that share nothing
but their ports. Two seconds into the path one of them is stopped for a second, killed, or killed and started
again; the run shall end, or go on. For each of the 18 cases the table says how the client ended, how much its
record holds, and how near the robot came to its limits of speed and acceleration, in the commands of the
record and in the true motion of the links. It takes about ten minutes, in real time; words choose cases:
``faults cell kill``.
"""

import os
import signal
import sys
import tempfile
import time
from itertools import product
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from experiments.bench.guided.three_processes import Outcome, ThreeProcesses
from experiments.cli.console import progress_bar

WHO, WHAT, THEN = ("client", "cell", "camera"), ("stop 1 s", "kill", "restart"), ("end", "resume")
_STOPPED = 1.0  # s, how long a process stands still


def run_case(folder: Path, who: str, what: str, then: str) -> Outcome:
    """Three processes, one of which comes to harm. Raises RuntimeError if they do not come to the path."""
    with ThreeProcesses(folder, resumes=then == "resume") as three:
        three.wait_for_path()
        _harm(three, who, what)
        said = three.client_end()
        time.sleep(2.0)  # in which a robot that nobody guides any more comes to rest
        three.end("cell")
    return three.outcome(said)


def _harm(three: ThreeProcesses, who: str, what: str) -> None:
    process = three.processes[who]
    if what == "stop 1 s":
        process.send_signal(signal.SIGSTOP)
        time.sleep(_STOPPED)
        process.send_signal(signal.SIGCONT)
        return
    process.kill()
    process.communicate()
    if what == "restart":
        time.sleep(0.3 if who != "client" else 1.0)
        three.start(who)


def main(chosen: list[str]) -> None:
    """Runs the cases whose words are all among the arguments, or all of them, and prints the table."""
    cases = [case for case in product(WHO, WHAT, THEN) if set(chosen) <= set(" ".join(case).split())]
    table = Table(box=box.SIMPLE_HEAD)
    for name in ("who", "what", "then", "the client ended with", "recorded", "commands", "links", "at rest"):
        table.add_column(name, overflow="fold")
    with progress_bar(f"{len(cases)} cases in real time") as progress:
        for number, case in enumerate(cases):
            with tempfile.TemporaryDirectory(prefix="truetip-faults-") as folder:
                try:
                    outcome = run_case(Path(folder), *case)
                except RuntimeError as error:
                    outcome = Outcome(str(error), 0.0, (np.nan, np.nan), (np.nan, np.nan), None)
            ended, *shares = outcome.cells()
            table.add_row(*case, ended, f"{outcome.recorded:.1f} s", *shares)
            progress((number + 1) / len(cases))
    Console(width=None if sys.stdout.isatty() else 160).print(table)
    print("commands and links: largest shares of the limits of speed / acceleration")


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main(sys.argv[1:])
