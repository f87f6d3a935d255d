"""The command line. What takes more than a page has a module of its own."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from diagrams.record.log import RunLog
from diagrams.runs.simulation import Experiment
from experiments.accept.command import accept_app
from experiments.calibration.calibrate_command import calibrate_command
from experiments.calibration.design_command import design_command
from experiments.cameras.command import cameras_app
from experiments.cli.cluster import executor
from experiments.cli.command_app import command_app
from experiments.cli.console import (
    count,
    print_note,
    progress_bar,
    refusing,
    wait_for_interrupt,
)
from experiments.cli.ending import clean_up_on_sigterm
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, positive
from experiments.cli.options import (
    AnyScenarioOption,
    CameraOption,
    FeedforwardOption,
    FoxgloveOption,
    JobsOption,
    LapsOption,
    McapOption,
    OutOption,
    RealTimeOption,
    RobotOption,
    ScenarioOption,
    SchedulerOption,
    SetOption,
    StationOption,
    WithCellOption,
    YesOption,
    json_option,
)
from experiments.cli.prepare import Prepared, check, prepare
from experiments.cli.staging import staged_file, staged_folder
from experiments.cli.tables import print_summary
from experiments.comparison.compare import compare, compared_laws, named_laws, simulating
from experiments.comparison.learnt_file import WriteOption, check_write, robot_writer
from experiments.comparison.results import RESULTS, write_results
from experiments.compensate.command import compensate_command
from experiments.diagram.view import write_diagram
from experiments.doctor.command import doctor_command
from experiments.drivetrain.command import drivetrain_command
from experiments.feedforward.command import feedforward_command
from experiments.frames.commands import align_command, chain_command, frame_command, tool_command
from experiments.health.command import health_command
from experiments.identify.command import identify_command
from experiments.invert.command import invert_command
from experiments.metrics.run_metrics import timing, with_timing
from experiments.modes.command import modes_command
from experiments.plan.command import plan_command
from experiments.plan.plan_option import PlanOption, plan_settings
from experiments.record.log_command import log_command
from experiments.record.report_command import report_command
from experiments.record.runs_command import runs_command
from experiments.record.simulated import write_records
from experiments.replay.live import LiveView, advance_live
from experiments.report.report import verdict
from experiments.robots.command import robots_app
from experiments.robustness.command import robustness_command
from experiments.scenarios.command import scenarios_command
from experiments.station.cell_command import cell_command
from experiments.station.guided_command import (
    Guided,
    ask_before_moving,
    foxglove_server,
    guide,
    on_station,
    refuse_real_time,
)
from experiments.station.latency_command import latency_command
from experiments.study.command import study_command
from experiments.watch.command import watch_command
from experiments.zeros.command import zeros_command
from systems.servo import LAWS

app = command_app(
    "Puts the true tip of an industrial robot on its path: visual-servo laws, simulated and compared.",
    completes=True,
)

LawOption = Annotated[
    str | None,
    typer.Option(
        "--law",
        metavar="NAME|FILE:CLASS",
        help=f"One of {', '.join(LAWS)}, or my_law.py:MyLaw.",
        show_default="the scenario's",
    ),
]
LawsOption = Annotated[
    str | None,
    typer.Option(
        "--laws",
        metavar="A,B,...",
        help="Which laws, by name or as my_law.py:MyLaw.",
        show_default=",".join(compared_laws()),
    ),
]


def main() -> None:
    """The console command."""
    clean_up_on_sigterm()
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
    laws: LawsOption = None,
    scenario: AnyScenarioOption = None,
    settings: SetOption = None,
    robot: RobotOption = None,
    feedforward: FeedforwardOption = None,
    camera: CameraOption = None,
    plan: PlanOption = None,
    station: StationOption = None,
    with_cell: WithCellOption = False,
    yes: YesOption = False,
    out: OutOption = Path("out"),
    json_file: Annotated[
        str | None, json_option("The summary once more; - prints it, and nothing else.")
    ] = None,
    is_quick: Annotated[
        bool, typer.Option("--quick", help="One cycle, a faster path, less settling: a few seconds.")
    ] = False,
    cycles: Annotated[
        int, typer.Option(metavar="N", help="Runs of each law; repeatability needs at least two.")
    ] = 3,
    laps: LapsOption = None,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    write: WriteOption = None,
    mcap: McapOption = False,
    foxglove: FoxgloveOption = None,
    realtime: RealTimeOption = None,
) -> None:
    """Run several laws on one scenario, by default the open loop and three others, and compare them."""
    human = human_console(json_file)
    with refusing(ValueError, OSError):
        at_least("--cycles", 1, cycles)
        at_least("--jobs", 1, jobs)
        cycles = 1 if is_quick else cycles
        chosen = named_laws(laws)
        check_write(write, chosen)
        changes = [*plan_settings(plan), *_settings(settings, None, feedforward, camera, laps)]
        name, changes = on_station(scenario, changes, station, with_cell)
        prepared = prepare(name, changes, robot, is_quick)
        check(prepared, chosen)
        where = executor(scheduler, jobs)
        print_note(human, prepared.note)
        is_guided = prepared.scenario.station.kind != "simulated"
        if is_guided:
            ask_before_moving(human, prepared, with_cell or yes)
        viewer = foxglove_server(human, prepared, foxglove)
        refuse_real_time(prepared, realtime)
    guided: Guided | None = None
    with json_output(json_file) as output, refusing(OSError), ExitStack() as stack:
        stage = stack.enter_context(staged_folder(out))
        keep_robot = robot_writer(stack, write, chosen)
        stack.enter_context(output.staged())
        if is_guided:
            guided = guide(human, (stage, out), prepared, chosen, cycles, with_cell, viewer, realtime)
            logs = guided.logs
        else:
            runs = cycles * len(chosen)
            with progress_bar(f"{count(runs, 'run')} {where.place(runs)}") as progress:
                logs = compare(prepared.scenario, prepared.robot, chosen, cycles, where, progress)
        result = _write(human, stage, prepared, logs)
        keep_robot(logs)
        if mcap and not guided:
            write_records(stage, prepared.text, logs)
        output.write(with_timing(result, timing(logs)))
    _conclude(human, result, out, write)
    if guided:
        guided.conclude()


@app.command("run")
def run_command(
    law: LawOption = None,
    scenario: AnyScenarioOption = None,
    settings: SetOption = None,
    robot: RobotOption = None,
    feedforward: FeedforwardOption = None,
    camera: CameraOption = None,
    laps: LapsOption = None,
    station: StationOption = None,
    with_cell: WithCellOption = False,
    yes: YesOption = False,
    out: OutOption = Path("out"),
    meshcat: Annotated[bool, typer.Option("--meshcat", help="Show it live in a browser.")] = False,
    pace: Annotated[
        float | None,
        typer.Option(metavar="RATE", help="Largest real-time factor of a simulation: 1 is real time."),
    ] = None,
    write: WriteOption = None,
    mcap: McapOption = False,
    foxglove: FoxgloveOption = None,
    realtime: RealTimeOption = None,
) -> None:
    """Run one law."""
    console = Console()
    with refusing(ValueError, OSError):
        positive("--pace", pace)
        changes = _settings(settings, law, feedforward, camera, laps)
        name, changes = on_station(scenario, changes, station, with_cell)
        prepared = prepare(name, changes, robot)
        law = prepared.scenario.law
        check_write(write, [law])
        check(prepared, [law])
        print_note(console, prepared.note)
        is_guided = prepared.scenario.station.kind != "simulated"
        if is_guided:
            if meshcat or pace is not None:
                raise ValueError("--meshcat and --pace belong to a simulated station")
            ask_before_moving(console, prepared, with_cell or yes)
        viewer = foxglove_server(console, prepared, foxglove)
        refuse_real_time(prepared, realtime)
    guided: Guided | None = None
    view: LiveView | None = None
    with refusing(OSError), ExitStack() as stack:
        stage = stack.enter_context(staged_folder(out))
        keep_robot = robot_writer(stack, write, [law])
        if is_guided:
            guided = guide(console, (stage, out), prepared, [law], 1, with_cell, viewer, realtime)
            logs = guided.logs
        else:
            experiment = Experiment(prepared.scenario, law, prepared.robot)
            view = LiveView(experiment, prepared.nominal_robot) if meshcat else None
            if view:
                console.print(f"Watch it at {view.address}")
            if pace is not None:
                experiment.simulator.set_target_realtime_rate(pace)
                experiment.simulator.ResetStatistics()  # the pace counts from here
            with simulating(law, prepared.scenario.seed), progress_bar(law) as progress:
                if view:
                    advance_live(experiment, view, progress)
                else:
                    experiment.advance(progress=progress)
            logs = {law: [experiment.log()]}
        result = _write(console, stage, prepared, logs)
        keep_robot(logs)
        if mcap and not guided:
            write_records(stage, prepared.text, logs)
    _conclude(console, result, out, write)
    if guided:
        guided.conclude()
    if view:
        wait_for_interrupt(console, f"Still at {view.address}; Ctrl-C ends it")


@app.command("diagram")
def diagram_command(
    law: LawOption = None,
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    robot: RobotOption = None,
    out: Annotated[
        Path,
        typer.Option(metavar="FILE.svg|FILE.dot", help="The drawing as SVG, or its source for graphviz."),
    ] = Path("diagram.svg"),
    depth: Annotated[int, typer.Option(metavar="N", help="Depth to which nested diagrams are expanded.")] = 2,
) -> None:
    """Draw the diagram that is simulated."""
    with refusing(ValueError, OSError):
        prepared = prepare(scenario, _settings(settings, law, None), robot)
        experiment = Experiment(prepared.scenario, prepared.scenario.law, prepared.robot)
        with staged_file(out) as path:
            write_diagram(path, experiment.diagram, depth)
    Console().print(f"The diagram: {escape(str(out))}")


app.command("cell")(cell_command)
app.command("latency")(latency_command)
app.command("log")(log_command)
app.command("report")(report_command)
app.command("runs")(runs_command)
app.command("modes")(modes_command)
app.command("zeros")(zeros_command)
app.add_typer(cameras_app, name="cameras")
app.command("feedforward")(feedforward_command)
app.command("invert")(invert_command)
app.command("identify")(identify_command)
app.command("plan")(plan_command)
app.command("design")(design_command)
app.command("calibrate")(calibrate_command)
app.command("compensate")(compensate_command)
app.command("drivetrain")(drivetrain_command)
app.command("robustness")(robustness_command)
app.command("study")(study_command)
app.command("frame")(frame_command)
app.command("chain")(chain_command)
app.command("tool")(tool_command)
app.command("align")(align_command)
app.add_typer(robots_app, name="robots")
app.command("watch")(watch_command)
app.add_typer(accept_app, name="accept")
app.command("health")(health_command)
app.command("scenarios")(scenarios_command)
app.command("doctor")(doctor_command)


def _settings(
    settings: list[str] | None,
    law: str | None,
    feedforward: str | None,
    camera: str | None = None,
    laps: int | None = None,
) -> list[str]:
    """The changes of a scenario that options of their own make, behind those of --set."""
    own = {
        "law": law,
        "servo.feedforward.kind": feedforward,
        "station.camera.kind": camera,
        "reference.laps": laps,
    }
    # An empty name is a name that does not exist, and not what YAML makes of nothing.
    return [
        *(settings or []),
        *(f"{key}={repr('') if value == '' else value}" for key, value in own.items() if value is not None),
    ]


def _write(
    console: Console, stage: Path, prepared: Prepared, logs: Mapping[str, Sequence[RunLog]]
) -> dict[str, Any]:
    with console.status("Writing the report"):
        return write_results(stage, prepared, logs)


def _conclude(console: Console, result: Mapping[str, Any], out: Path, robot_file: str | None = None) -> None:
    print_summary(console, result)
    console.print(escape(verdict(result)))
    console.print()
    for name, purpose in RESULTS.items():
        console.print(f"{escape(str(out / name))}  [dim]{purpose}[/dim]", soft_wrap=True)
    if robot_file:
        console.print(f"{escape(robot_file)}  [dim]the calibrated robot[/dim]", soft_wrap=True)


if __name__ == "__main__":
    main()
