"""``truetip run``: one law on one scenario."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from diagrams.scenario.scenario_file import OptionSetting
from experiments.cli.console import (
    print_note,
    progress_bar,
    refusing,
    wait_for_interrupt,
)
from experiments.cli.option_limits import positive
from experiments.cli.options import (
    AnyScenarioOption,
    CameraOption,
    FeedforwardOption,
    FoxgloveOption,
    LapsOption,
    LawOption,
    McapOption,
    OutOption,
    RealTimeOption,
    RobotOption,
    SetOption,
    StationOption,
    WithCellOption,
    YesOption,
)
from experiments.cli.prepare import check, option_settings, prepare
from experiments.cli.staging import staged_folder
from experiments.cli.tables import conclude
from experiments.comparison.compare import simulating
from experiments.comparison.learnt_file import WriteOption, check_write, robot_writer
from experiments.comparison.results import replacing
from experiments.record.replaced import replaced_records
from experiments.record.simulated import write_records
from experiments.replay.live import LiveView, advance_live
from experiments.running.outcome import print_outcome, write_outcome
from experiments.station.guided_command import (
    Guided,
    ask_before_moving,
    foxglove_server,
    guide,
    on_station,
    refuse_real_time,
)
from experiments.station.path_correction import JOINT, PATH_CORRECTION, correct_path, refuse_mode

_PATIENCE = 20.0  # s, until a browser shows what is to be watched


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
    live: Annotated[
        bool,
        typer.Option(
            "--live", "--meshcat", help="Show it in a browser while it runs, in real time or at --pace."
        ),
    ] = False,
    pace: Annotated[
        float | None,
        typer.Option(metavar="RATE", help="Largest real-time factor of a simulation: 1 is real time."),
    ] = None,
    write: WriteOption = None,
    mcap: McapOption = False,
    foxglove: FoxgloveOption = None,
    realtime: RealTimeOption = None,
    mode: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="joint: a law guides the robot; path_correction: an ABB controller runs its own path and is "
            "corrected across it.",
        ),
    ] = JOINT,
) -> None:
    """Run one law, or correct the path that a controller runs itself."""
    console = Console()
    with refusing(ValueError, OSError):
        positive("--pace", pace)
        changes = option_settings(settings, law, feedforward, camera, laps)
        name, changes = on_station(scenario, changes, station, with_cell)
        if mode == PATH_CORRECTION and load_scenario(name, changes).station.link.kind == "egm":
            changes = [*changes, OptionSetting("station.link.run.path_correction", "true", "--mode")]
        prepared = prepare(name, changes, robot)
        given = {
            "--law": law, "--feedforward": feedforward, "--laps": laps, "--live": live, "--pace": pace,
            "--write": write, "--foxglove": foxglove, "--realtime": realtime,
        }  # fmt: skip
        refuse_mode(mode, prepared, given)
        if mode == PATH_CORRECTION:
            ask_before_moving(console, prepared, with_cell or yes)
            correct_path(console, prepared, with_cell, out)
            return
        law = prepared.scenario.law
        check_write(write, [law])
        check(prepared, [law])
        print_note(console, prepared.note)
        is_guided = prepared.scenario.station.kind != "simulated"
        if is_guided:
            if live or pace is not None:
                raise ValueError(
                    "--live and --pace belong to a simulated station; --foxglove shows a real one"
                )
            ask_before_moving(console, prepared, with_cell or yes)
        viewer = foxglove_server(console, prepared, foxglove)
        refuse_real_time(prepared, realtime)
    guided: Guided | None = None
    view: LiveView | None = None
    with refusing(OSError), ExitStack() as stack:
        stack.enter_context(replaced_records(out))
        stage = stack.enter_context(staged_folder(out, *replacing(out)))
        keep_robot = robot_writer(stack, write, [law])
        if is_guided:
            guided = guide(console, (stage, out), prepared, [law], 1, with_cell, viewer, realtime)
            logs = guided.logs
        else:
            experiment = Experiment(prepared.scenario, law, prepared.robot)
            view = LiveView(experiment, prepared.nominal_robot, speed=pace or 1.0) if live else None
            if view:
                console.print(f"Watch it at {view.address}; it begins when the page is open")
                console.print("Controls at the top right magnify, pause (space bar) and set the speed")
                if not view.wait_for_browser(_PATIENCE):
                    console.print(f"Nobody has opened the page in {_PATIENCE:g} s; it begins without")
            elif pace is not None:
                experiment.simulator.set_target_realtime_rate(pace)
                experiment.simulator.ResetStatistics()  # the pace counts from here
            with simulating(law, prepared.scenario.seed), progress_bar(law) as progress:
                if view:
                    advance_live(experiment, view, progress)
                else:
                    experiment.advance(progress=progress)
            logs = {law: [experiment.log()]}
        result = write_outcome(console, stage, prepared, logs)
        keep_robot(logs)
        if mcap and not guided:
            write_records(stage, prepared.text, logs)
    print_outcome(console, result, out, write)
    if guided:
        guided.conclude()
    if view:
        wait_for_interrupt(console, f"Still at {view.address}; Ctrl-C ends it")
    if not guided:
        conclude(result)
