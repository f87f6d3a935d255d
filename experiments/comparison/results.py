"""The result files of a comparison or a single run."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from diagrams.record.log import RunLog
from experiments.cli.prepare import Prepared, with_assumed
from experiments.cli.versions import versions_in, versions_line
from experiments.comparison.errors_table import ERRORS, write_errors
from experiments.comparison.figure import write_figure
from experiments.metrics.run_metrics import summary, timing
from experiments.replay.replay import watchers, write_replay
from experiments.report.files import write_json, write_text
from experiments.report.report import write_report

SCENARIO = "scenario.yaml"
RESULTS = {
    "report.html": "errors, plots and guard events; opens offline",
    "replay.html": "the robot in motion; opens offline",
    "figure.svg": "distance of the tip over time",
    "summary.json": "the numbers; a simulation with the same seed repeats them byte for byte",
    "timing.json": "wall times and real-time factors",
    ERRORS: "the errors of every sample",
    SCENARIO: "the scenario, to run it again",
}


def replacing(folder: Path) -> list[str]:
    """Names of `RESULTS` that must not be files that somebody has given to the command.

    A scenario that is itself the result of a run may be run again into its own folder.
    """
    own = folder / SCENARIO
    is_result = own.is_file() and bool(versions_in(own.read_text(encoding="utf-8", errors="replace")))
    return [name for name in RESULTS if name != SCENARIO or not is_result]


def write_results(folder: Path, prepared: Prepared, logs: Mapping[str, Sequence[RunLog]]) -> dict[str, Any]:
    """Writes `RESULTS` into a folder that exists.

    Args:
        folder: where to.
        prepared: what was run.
        logs: law -> one log per cycle; the first cycle is the one that is drawn.

    Returns:
        The summary.

    Raises:
        OSError: if the folder cannot be written.
    """
    result, times = with_assumed(summary(prepared.title, logs), prepared.robot), timing(logs)
    first_cycles = {law: cycles[0] for law, cycles in logs.items()}
    write_json(folder / "summary.json", result)
    write_json(folder / "timing.json", times)
    write_report(folder / "report.html", prepared.text, result, times, logs, prepared.true_robot)
    seen_by = watchers(prepared.scenario.station.camera, prepared.nominal_robot)
    write_replay(folder / "replay.html", prepared.true_robot, first_cycles, seen_by=seen_by)
    write_errors(folder / ERRORS, first_cycles)
    title, _, fields = prepared.text.partition("\n")
    write_text(folder / SCENARIO, f"{title}\n{versions_line()}\n{fields}")
    write_figure(folder / "figure.svg", prepared.title, first_cycles)
    return result
