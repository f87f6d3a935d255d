"""Runs ``truetip`` inside the test: arguments in; exit code, stdout and stderr out."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from experiments.cli import app

# A small circle in 1.8 s of simulated time.
SHORT = [
    "--set=reference.path=circle",
    "--set=reference.acceleration=8",
    "--set=reference.settle=0.2",
    "--set=reference.dwell=0.6",
]
RESULTS = {"report.html", "replay.html", "figure.svg", "summary.json", "timing.json"}


@dataclass(frozen=True)
class Outcome:
    """What a command left behind."""

    code: int
    out: str
    err: str


def truetip(capsys: pytest.CaptureFixture[str], *arguments: object) -> Outcome:
    """Runs one command."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as end:
        app([str(argument) for argument in arguments], prog_name="truetip")
    captured = capsys.readouterr()
    return Outcome(int(end.value.code or 0), captured.out, captured.err)


def files(folder: Path) -> set[str]:
    """Everything in a folder, hidden things too."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}
