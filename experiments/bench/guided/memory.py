"""How the memory of a guided run grows: ``python -m experiments.bench.guided.memory [MINUTES]``.

A client guides a virtual cell over loopback at 248 Hz in real time, three minutes by default, with its record
on disk. From half a minute into the path on the resident memory of both is read every second; the line
through what was read says what ten minutes would add. It is printed what was measured and what is
extrapolated.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from experiments.bench.guided.three_processes import CIRCLE, ThreeProcesses
from experiments.cli.console import progress_bar

_FIRST = 30.0  # s of the path, in which what is imported late and buffers have come to their size
_ALLOWED = 20.0  # MB in ten minutes


def resident(process: int) -> float:
    """Memory of a process that is in use, in MB; NaN if there is none."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return float("nan")
    return 1e-6 * pages * os.sysconf("SC_PAGE_SIZE")


def grown(minutes: float) -> dict[str, tuple[float, float]]:
    """By process: MB that came while it was measured, and MB in ten minutes along the line."""
    # A machine that is late shall cost samples, not end the run.
    patient = ("servo.guard.stop_after=60", "station.link.break_after=1")
    path = (*CIRCLE, *patient, f"reference.settle={_FIRST + 60.0 * minutes + 60.0:g}")
    rows = []
    with (
        tempfile.TemporaryDirectory(prefix="truetip-memory-") as folder,
        ThreeProcesses(Path(folder), path, resumes=True, with_truth=False) as three,
        progress_bar(f"{minutes:g} minutes of a guided run") as progress,
    ):
        three.wait_for_path()
        time.sleep(_FIRST)
        began = time.monotonic()
        while (passed := time.monotonic() - began) < 60.0 * minutes:
            rows.append((passed, *(resident(three.processes[who].pid) for who in ("client", "cell"))))
            progress(passed / (60.0 * minutes))
            time.sleep(1.0)
        if three.processes["client"].poll() is not None:
            raise RuntimeError(f"the client ended early: {three.client_end()}")
    seconds, *sizes = np.array(rows).T
    return {
        who: (float(size[-1] - size[0]), 600.0 * float(np.polyfit(seconds, size, 1)[0]))
        for who, size in zip(("client", "cell"), sizes, strict=True)
    }


def main() -> None:
    """Prints a line for each process; exit code 1 if one grows by more than is allowed."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 3.0
    found = grown(minutes)
    for who, (came, slope) in found.items():
        print(f"{who:6s} {came:+6.2f} MB in {minutes:g} min; {slope:+6.2f} MB in 10 min, extrapolated")
    sys.exit(any(slope > _ALLOWED for _, slope in found.values()))


if __name__ == "__main__":
    main()
