"""Runs ``truetip`` inside a test, and says what it refuses and what it leaves behind."""

import re
from pathlib import Path

from typer.testing import CliRunner, Result

from experiments.main import app

# A small circle in 1.8 s of simulated time.
SHORT = [
    "--set=reference.path=circle",
    "--set=reference.acceleration=8",
    "--set=reference.settle=0.2",
    "--set=reference.dwell=0.6",
]
RESULTS = {
    "report.html",
    "replay.html",
    "figure.svg",
    "summary.json",
    "timing.json",
    "errors.csv",
    "scenario.yaml",
}


def truetip(*arguments: object) -> Result:
    """Runs one command; a defect in it is raised as it is."""
    return CliRunner().invoke(app, list(map(str, arguments)), prog_name="truetip", catch_exceptions=False)


def refusal(result: Result) -> str:
    """The line in which a command says why it will not run, which has to be all that it says."""
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    assert re.fullmatch("truetip: .*\n", result.stderr), result.stderr
    return result.stderr


def files(folder: Path) -> set[str]:
    """Everything in a folder, hidden things too."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}
