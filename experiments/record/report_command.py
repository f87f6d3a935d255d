"""``truetip report``: the page of runs again, from their records."""

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer
from rich.markup import escape

from diagrams.record.log import RunLog
from diagrams.record.read_record import read_record
from diagrams.record.restored import restored
from diagrams.scenario.differences import scenario_differences
from experiments.cli.console import print_files, print_note, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.options import JsonOption, PictureOption
from experiments.cli.prepare import prepare, with_assumed
from experiments.cli.staging import PAGE, staged_file
from experiments.cli.tables import conclude, print_summary
from experiments.metrics.run_metrics import summary
from experiments.report.report import verdict, write_report
from robots.description.model import RobotModel

# Fields that may differ between runs of one scenario.
_OF_A_RUN = ("description", "law", "seed", "station.link.")


def report_command(
    records: Annotated[
        list[Path], typer.Argument(metavar="FILE.mcap...", help="Records of runs of one scenario.")
    ],
    report: PictureOption = Path("out/report.html"),
    json_file: JsonOption = None,
) -> None:
    """Make the report of runs again from their records; several cycles of a law count as one comparison."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        page = stack.enter_context(staged_file(report, *PAGE))
        stack.enter_context(output.staged())
        with progress_bar("reading") as progress:
            text, logs = _read(records, progress)
        result, true = summary(_title(text, records), logs), None
        if (robots := _robots(text)) is not None:
            known, true = robots
            result = with_assumed(result, known)
        write_report(page, text, result, _times(logs), logs, true)
        output.write(result)
    print_note(human, result.get("assumed", ""))
    print_summary(human, result)
    human.print(escape(verdict(result)))
    print_files(human, report)
    conclude(result)


def _read(records: list[Path], progress: Any) -> tuple[str, dict[str, list[RunLog]]]:
    """The scenario of the first record, and the logs of each law in the order of their seeds.

    Raises:
        ValueError: if a record does not hold a whole run, two hold the same, or one is of another scenario.
    """
    text, logs = "", dict[str, list[RunLog]]()
    for number, file in enumerate(records):
        contents = read_record(file)
        log = restored(contents, str(file))
        if any(log.seed == other.seed for other in logs.get(log.law, [])):
            raise ValueError(f"{file}: a run of law {log.law} with seed {log.seed} is there twice")
        logs.setdefault(log.law, []).append(log)
        text = text or contents.scenario
        _refuse_another(file, contents.scenario, records[0], text)
        progress((number + 1) / len(records))
    return text, {law: sorted(cycles, key=lambda log: log.seed) for law, cycles in logs.items()}


def _refuse_another(file: Path, text: str, first: Path, of_first: str) -> None:
    """Raises ValueError if a record is of another scenario than the first: they would look like one."""
    differing = [
        f"{place} is {here} here and {there} there"
        for place, here, there in scenario_differences(text, of_first)
        if not place.startswith(_OF_A_RUN)
    ]
    if differing:
        more = f" ({len(differing)} fields differ)" if len(differing) > 1 else ""
        raise ValueError(f"{file}: a run of another scenario than {first}: {differing[0]}{more}")


def _robots(text: str) -> tuple[RobotModel, RobotModel] | None:
    """The robot of a scenario as its controller knows it and as it truly is; None if its files are gone."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scenario.yaml"
        file.write_text(text, encoding="utf-8")
        try:
            prepared = prepare(str(file))
            return prepared.robot, prepared.true_robot
        except ValueError:
            return None


def _title(text: str, records: list[Path]) -> str:
    """What stands above the scenario in a record; else the name of the file."""
    first = text.partition("\n")[0]
    return first.removeprefix("#").strip() if first.startswith("#") else records[0].stem


def _times(logs: dict[str, list[RunLog]]) -> dict[str, Any]:
    """As `experiments.metrics.run_metrics.timing`, of runs whose wall time nobody has kept."""
    simulated = {
        law: sum(float(log.time[-1] - log.time[0]) for log in cycles) for law, cycles in logs.items()
    }
    return {
        "runs": {
            law: {"wall_s": None, "simulated_s": seconds, "real_time_factor": None}
            for law, seconds in simulated.items()
        }
    }
