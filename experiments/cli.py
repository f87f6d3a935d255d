"""The command line: ``truetip compare``, ``run``, ``diagram``, ``scenarios`` and ``robots``."""

import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from diagrams.log import RunLog
from diagrams.run import Experiment
from diagrams.scenario import load_scenario, shipped_scenarios
from experiments.compare import SimulationError, compare, simulating, usable_cores
from experiments.diagram_view import write_diagram
from experiments.live import LiveView, advance_live
from experiments.prepare import Prepared, check, prepare
from experiments.report import verdict
from experiments.results import RESULTS, write_results
from experiments.staging import staged_file, staged_folder
from experiments.tables import print_summary
from robots.model import load_robot, shipped_robots
from systems.servo import COMPARED_LAWS, LAWS

BAD_INPUT, BROKEN_OFF, INTERRUPTED = 2, 1, 130  # exit codes

app = typer.Typer(
    help="Puts the true tip of an industrial robot on its path: visual-servo laws, simulated and compared.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

ScenarioOption = Annotated[
    str, typer.Option("--scenario", metavar="NAME|FILE", help="A shipped scenario or a YAML file.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a value, as station.payload=0; repeatable."),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        "--robot",
        metavar="NAME|FILE",
        help="A robot in place of the scenario's, or a calibrated one for the controller.",
    ),
]
LawOption = Annotated[
    str | None,
    typer.Option("--law", metavar="NAME", help=f"One of {', '.join(LAWS)}.", show_default="the scenario's"),
]
OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the results go.")]


def main() -> None:
    """The console command."""
    app(prog_name="truetip")


def _print_version(wanted: bool) -> None:
    if wanted:
        try:
            typer.echo(f"truetip {version('truetip')}")
        except PackageNotFoundError:
            typer.echo("truetip, not installed")
        raise typer.Exit


@app.callback()
def _options(
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


@app.command("compare")
def compare_command(
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    robot: RobotOption = None,
    out: OutOption = Path("out"),
    json_file: Annotated[
        str | None,
        typer.Option("--json", metavar="FILE", help="The summary once more; - prints it, and nothing else."),
    ] = None,
    is_quick: Annotated[
        bool, typer.Option("--quick", help="One cycle, a faster path, less settling: a few seconds.")
    ] = False,
    cycles: Annotated[
        int, typer.Option(metavar="N", help="Runs of each law; those after the first serve repeatability.")
    ] = 3,
    jobs: Annotated[
        int | None, typer.Option(metavar="N", help="Processes at a time.", show_default="one per core")
    ] = None,
) -> None:
    """Run the open loop and the three laws on one scenario and compare them."""
    human = Console(stderr=json_file == "-")
    with _refusing(ValueError, OSError):
        if cycles < 1 or (jobs is not None and jobs < 1):
            name, number = ("--cycles", cycles) if cycles < 1 else ("--jobs", jobs)
            raise ValueError(f"{name} must be at least 1, got {number}")
        cycles = 1 if is_quick else cycles
        prepared = prepare(scenario, settings or [], robot, is_quick)
        check(prepared, list(COMPARED_LAWS))
    with _refusing(OSError), ExitStack() as stack:
        stage = stack.enter_context(staged_folder(out))
        copy = stack.enter_context(staged_file(json_file)) if json_file not in (None, "-") else None
        processes = min(jobs or usable_cores(), cycles * len(COMPARED_LAWS))
        label = f"{_count(cycles * len(COMPARED_LAWS), 'run')} in {_count(processes, 'process', 'processes')}"
        with _progress(label) as progress:
            logs = compare(
                prepared.scenario, prepared.robot, list(COMPARED_LAWS), cycles, processes, progress
            )
        result = _write(human, stage, prepared, logs)
        if copy:
            shutil.copyfile(stage / "summary.json", copy)
        text = (stage / "summary.json").read_text(encoding="utf-8")
    if json_file == "-":
        sys.stdout.write(text)
    _conclude(human, result, out)


@app.command("run")
def run_command(
    law: LawOption = None,
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    robot: RobotOption = None,
    out: OutOption = Path("out"),
    meshcat: Annotated[bool, typer.Option("--meshcat", help="Show it live in a browser.")] = False,
    realtime: Annotated[
        float | None,
        typer.Option(metavar="RATE", help="Simulated seconds per second at most: 1 is real time."),
    ] = None,
) -> None:
    """Run one law."""
    console = Console()
    with _refusing(ValueError, OSError):
        if realtime is not None and not 0.0 < realtime < math.inf:
            raise ValueError(f"--realtime must be positive, got {realtime:g}")
        prepared = prepare(scenario, [*(settings or []), *([f"law={law}"] if law else [])], robot)
        law = prepared.scenario.law
        check(prepared, [law])
    with _refusing(OSError), ExitStack() as stack:
        stage = stack.enter_context(staged_folder(out))
        experiment = Experiment(prepared.scenario, law, prepared.robot)
        view = LiveView(experiment, prepared.drawn_robot) if meshcat else None
        if view:
            console.print(f"Watch it at {view.address}")
        if realtime is not None:
            experiment.simulator.set_target_realtime_rate(realtime)
            experiment.simulator.ResetStatistics()  # the pace counts from here
        with simulating(law, prepared.scenario.seed), _progress(law) as progress:
            if view:
                advance_live(experiment, view, progress)
            else:
                experiment.advance(progress=progress)
        result = _write(console, stage, prepared, {law: [experiment.log()]})
    _conclude(console, result, out)
    if view and sys.stdin.isatty() and sys.stdout.isatty():
        _wait(console, view)


@app.command("diagram")
def diagram_command(
    law: LawOption = None,
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    robot: RobotOption = None,
    out: Annotated[
        Path, typer.Option(metavar="FILE.svg|FILE.dot", help="The picture, or its text for graphviz.")
    ] = Path("diagram.svg"),
    depth: Annotated[int, typer.Option(metavar="N", help="Levels of diagrams that are opened.")] = 2,
) -> None:
    """Draw the diagram that is simulated."""
    with _refusing(ValueError, OSError):
        prepared = prepare(scenario, [*(settings or []), *([f"law={law}"] if law else [])], robot)
        experiment = Experiment(prepared.scenario, prepared.scenario.law, prepared.robot)
        with staged_file(out) as path:
            write_diagram(path, experiment.diagram, depth)
    Console().print(f"The diagram: {escape(str(out))}")


@app.command("scenarios")
def scenarios_command() -> None:
    """List the scenarios that come with truetip."""
    _print_list((name, load_scenario(name).description) for name in shipped_scenarios())


@app.command("robots")
def robots_command() -> None:
    """List the robots that come with truetip."""
    _print_list((name, load_robot(name).name) for name in shipped_robots())


@contextmanager
def _refusing(*refusals: type[Exception]) -> Iterator[None]:
    """Turns what the user can mend into one line and an exit code; a defect still shows itself."""
    try:
        yield
    except refusals as error:
        _fail(str(error), BAD_INPUT)
    except SimulationError as error:
        _fail(str(error), BROKEN_OFF)
    except KeyboardInterrupt:
        _fail("interrupted, nothing was written", INTERRUPTED)


def _fail(message: str, code: int) -> None:
    typer.echo(f"truetip: {' '.join(message.split())}", err=True)
    raise typer.Exit(code)


@contextmanager
def _progress(label: str) -> Iterator[Callable[[float], None]]:
    """A progress bar on stderr; gives the function that tells it the share that is done."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=1.0)
        yield lambda share: bar.update(task, completed=share)


def _write(
    console: Console, stage: Path, prepared: Prepared, logs: Mapping[str, Sequence[RunLog]]
) -> dict[str, Any]:
    with console.status("Writing the report"):
        return write_results(stage, prepared, logs)


def _conclude(console: Console, result: Mapping[str, Any], out: Path) -> None:
    print_summary(console, result)
    console.print(escape(verdict(result)))
    console.print()
    for name, purpose in RESULTS.items():
        console.print(f"{escape(str(out / name))}  [dim]{purpose}[/dim]", soft_wrap=True)


def _wait(console: Console, view: LiveView) -> None:
    console.print(f"Still at {view.address}; Ctrl-C ends it")
    try:
        while True:
            time.sleep(1.0)
    except KeyboardInterrupt:
        console.print()


def _print_list(rows: Iterator[tuple[str, str]]) -> None:
    table = Table(box=box.SIMPLE, show_header=False)
    table.add_column(no_wrap=True, style="bold")
    table.add_column()
    for name, text in rows:
        table.add_row(escape(name), escape(text))
    Console().print(table)


def _count(number: int, one: str, many: str = "") -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"


if __name__ == "__main__":
    main()
