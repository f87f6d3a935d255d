"""Cost and accuracy against another commit: ``python -m experiments.bench.against COMMIT``.

Both commits run in processes of their own on one core and take turns, a tenth of a simulated second each, so
that a busy moment of the machine meets both. Times are CPU time; ratios are medians over the turns. The other
commit is checked out into a temporary worktree.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from experiments.bench.exact import EXACT
from experiments.comparison.compare import compared_laws
from experiments.report.files import write_json

ROOT = Path(__file__).resolve().parents[2]
SLICE = 0.1  # s of simulated time in a turn
SETTINGS = ["reference.settle=0.5"]  # standing at the start, then the first edge of the rectangle
NEW, OLD = "new", "old"


class Commit:
    """A process that runs experiments of one commit."""

    def __init__(self, tree: Path) -> None:
        """Starts it on the files of a directory."""
        env = os.environ | {
            "PYTHONPATH": str(tree),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        worker = str(Path(__file__).with_name("against_worker.py"))
        pipe = subprocess.PIPE
        command = [sys.executable, "-P", worker]
        self._process = subprocess.Popen(command, cwd=tree, env=env, stdin=pipe, stdout=pipe, text=True)

    def __call__(self, do: str, **request: Any) -> Any:
        """What a method of `against_worker.Worker` answers.

        Raises:
            RuntimeError: if the process has ended.
        """
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps({"do": do} | request) + "\n")
        process.stdin.flush()
        answer = process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the process of a commit ended at '{do}'; what it said stands above")
        return json.loads(answer)

    def close(self) -> None:
        """Ends the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


@contextmanager
def worktree(commit: str) -> Iterator[Path]:
    """A temporary worktree of a commit."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "commit"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "--detach", "--quiet", str(tree), commit], check=True)
        try:
            yield tree
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True)


@dataclass(frozen=True)
class Turns:
    """CPU and wall times in s of the turns, shape (n,), by commit and by what was run."""

    cpu: dict[tuple[str, str], np.ndarray]
    wall: dict[tuple[str, str], np.ndarray]
    span: float  # s of simulated time in all turns

    def ratio(self, what: str) -> float:
        """New over old, the median of the turns."""
        return float(np.median(self.cpu[NEW, what] / self.cpu[OLD, what]))

    def beyond_bare(self, commit: str) -> float:
        """What a turn of the closed loop costs more than one of the bare plant in s, the median."""
        return float(np.median(self.cpu[commit, "closed"] - self.cpu[commit, "bare"]))

    def real_time(self, commit: str) -> float:
        """Simulated over CPU time of the closed loop, the median of the turns."""
        return SLICE / float(np.median(self.cpu[commit, "closed"]))

    def wall_over_cpu(self) -> float:
        """How much of the core others had: one if nothing."""
        return sum(w.sum() for w in self.wall.values()) / sum(c.sum() for c in self.cpu.values())


def take_turns(commits: dict[str, Commit], law: str, span: float) -> tuple[Turns, float]:
    """Times closed loop and bare plant of both commits; also the largest distance of their tips in m."""
    with tempfile.TemporaryDirectory() as folder:
        tips = []
        for name, commit in commits.items():
            commit("closed", name="once", law=law, settings=SETTINGS)
            commit("advance", name="once", until=span)
            path = str(Path(folder) / f"{name}.npy")
            commit("save", name="once", path=path)
            tips.append(np.load(path))
            commit("bare", name="bare", closed="once", law=law, settings=SETTINGS)
            commit("drop", name="once")
            commit("closed", name="closed", law=law, settings=SETTINGS)
    times: dict[tuple[str, str], list[dict[str, float]]] = {
        (name, what): [] for what in ("closed", "bare") for name in commits
    }
    for turn in range(round(span / SLICE) - 1):
        for name, what in times:
            times[name, what].append(commits[name]("advance", name=what, until=(turn + 1) * SLICE))
    for commit in commits.values():
        for what in ("closed", "bare"):
            commit("drop", name=what)
    cpu, wall = (
        {key: np.array([turn[clock] for turn in turns]) for key, turns in times.items()}
        for clock in ("cpu", "wall")
    )
    return Turns(cpu, wall, span), float(np.linalg.norm(tips[0] - tips[1], axis=1).max())


def integration_error(commit: Commit, law: str, span: float) -> float:
    """The largest distance of the tip from the exact one in m, with the camera's noise."""
    with tempfile.TemporaryDirectory() as folder:
        tips, settings = [], SETTINGS
        for name in ("shipped", "exact"):
            path = str(Path(folder) / f"{name}.npy")
            commit("closed", name=name, law=law, settings=settings)
            commit("advance", name=name, until=span)
            commit("save", name=name, path=path)
            settings = SETTINGS + EXACT[commit("scheme", name=name)]
            commit("drop", name=name)
            tips.append(np.load(path))
    return float(np.linalg.norm(tips[0] - tips[1], axis=1).max())


def measure(
    commits: dict[str, Commit], laws: list[str], span: float, say: Any
) -> dict[str, dict[str, float]]:
    """All figures by law."""
    found = {}
    for law in laws:
        say(f"{law}: taking turns")
        turns, change = take_turns(commits, law, span)
        say(f"{law}: integration error")
        beyond = {name: turns.beyond_bare(name) for name in commits}
        found[law] = {
            "bare_ratio": turns.ratio("bare"),
            "closed_ratio": turns.ratio("closed"),
            "beyond_bare_ratio": beyond[NEW] / beyond[OLD],
            "closed_over_bare": float(np.median(turns.cpu[NEW, "closed"] / turns.cpu[NEW, "bare"])),
            "real_time": turns.real_time(NEW),
            "real_time_old": turns.real_time(OLD),
            "wall_over_cpu": turns.wall_over_cpu(),
            "tip_change_um": 1e6 * change,
            "integration_error_um": 1e6 * integration_error(commits[NEW], law, span),
        }
    return found


COLUMNS = {
    "bare_ratio": "bare, new/old",
    "beyond_bare_ratio": "beyond bare, new/old",
    "closed_ratio": "closed, new/old",
    "closed_over_bare": "closed/bare",
    "real_time": "real time",
    "real_time_old": "of old",
    "integration_error_um": "integration um",
    "tip_change_um": "tip moved um",
    "wall_over_cpu": "wall/CPU",
}


def main() -> None:
    """Reads the command line, measures, prints a table and writes JSON."""
    parser = argparse.ArgumentParser(prog="python -m experiments.bench.against", description=__doc__)
    parser.add_argument("commit", help="to compare the present files with")
    parser.add_argument("--laws", default=",".join(compared_laws()), help="separated by commas")
    parser.add_argument("--span", type=float, default=4.0, help="simulated time of a run in s")
    parser.add_argument("--json", default="against.json", help="where the figures go")
    options = parser.parse_args()
    console = Console(width=None if sys.stdout.isatty() else 140)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with worktree(options.commit) as tree, console.status("Measuring") as status:
        commits = {OLD: Commit(tree), NEW: Commit(ROOT)}
        try:
            found = measure(commits, options.laws.split(","), options.span, status.update)
        finally:
            for commit in commits.values():
                commit.close()
    table = Table("law", box=box.SIMPLE_HEAD)
    for title in COLUMNS.values():
        table.add_column(title, justify="right")
    for law, figures in found.items():
        table.add_row(law, *(f"{figures[key]:.3g}" for key in COLUMNS))
    console.print(table)
    write_json(options.json, found)


if __name__ == "__main__":
    main()
