"""``truetip compare``: several laws on one scenario."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from experiments.cli.cluster import executor
from experiments.cli.console import (
    count,
    print_note,
    progress_bar,
    refusing,
)
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least
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
    SchedulerOption,
    SetOption,
    StationOption,
    WithCellOption,
    YesOption,
    json_option,
)
from experiments.cli.prepare import check, option_settings, prepare
from experiments.cli.staging import staged_folder
from experiments.cli.tables import conclude
from experiments.comparison.compare import compare, compared_laws, named_laws
from experiments.comparison.learnt_file import WriteOption, check_write, robot_writer
from experiments.comparison.results import replacing
from experiments.metrics.run_metrics import timing, with_timing
from experiments.plan.plan_option import PlanOption, plan_settings
from experiments.record.replaced import replaced_records
from experiments.record.simulated import write_records
from experiments.running.outcome import print_outcome, write_outcome
from experiments.station.guided_command import (
    Guided,
    ask_before_moving,
    foxglove_server,
    guide,
    on_station,
    refuse_real_time,
)

LawsOption = Annotated[
    str | None,
    typer.Option(
        "--laws",
        metavar="A,B,...",
        help="Which laws, by name or as my_law.py:MyLaw.",
        show_default=",".join(compared_laws()),
    ),
]


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
        changes = [*plan_settings(plan), *option_settings(settings, None, feedforward, camera, laps)]
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
        stack.enter_context(replaced_records(out))
        stage = stack.enter_context(staged_folder(out, *replacing(out)))
        keep_robot = robot_writer(stack, write, chosen)
        stack.enter_context(output.staged())
        if is_guided:
            guided = guide(human, (stage, out), prepared, chosen, cycles, with_cell, viewer, realtime)
            logs = guided.logs
        else:
            runs = cycles * len(chosen)
            with progress_bar(f"{count(runs, 'run')} {where.place(runs)}") as progress:
                logs = compare(prepared.scenario, prepared.robot, chosen, cycles, where, progress)
        result = write_outcome(human, stage, prepared, logs)
        keep_robot(logs)
        if mcap and not guided:
            write_records(stage, prepared.text, logs)
        output.write(with_timing(result, timing(logs)))
    print_outcome(human, result, out, write)
    if guided:
        guided.conclude()
    else:
        conclude(result)
