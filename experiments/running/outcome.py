"""What `compare` and `run` do alike: settings of their options, and what a run leaves."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from diagrams.record.log import RunLog
from experiments.cli.prepare import Prepared
from experiments.cli.tables import print_summary
from experiments.comparison.results import RESULTS, write_results
from experiments.report.report import verdict


def write_outcome(
    console: Console, stage: Path, prepared: Prepared, logs: Mapping[str, Sequence[RunLog]]
) -> dict[str, Any]:
    """Writes the result files into a folder that exists, and gives the summary."""
    with console.status("Writing the report"):
        return write_results(stage, prepared, logs)


def print_outcome(
    console: Console, result: Mapping[str, Any], out: Path, robot_file: str | None = None
) -> None:
    """Prints the table, the verdict, and which files there are."""
    print_summary(console, result)
    console.print(escape(verdict(result)))
    console.print()
    for name, purpose in RESULTS.items():
        console.print(f"{escape(str(out / name))}  [dim]{purpose}[/dim]", soft_wrap=True)
    if robot_file:
        console.print(f"{escape(robot_file)}  [dim]the calibrated robot[/dim]", soft_wrap=True)
