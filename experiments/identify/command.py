"""``truetip identify``: stiffness and damping of a robot from its own motion."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.cli.cluster import executor
from experiments.cli.console import count, print_files, print_table, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, refuse_given
from experiments.cli.options import (
    JobsOption,
    JsonOption,
    PictureOption,
    SchedulerOption,
    StudiedRobotOption,
)
from experiments.cli.prepare import noted_robot, with_assumed
from experiments.cli.staging import PAGE, TABLE, YAML, refuse_replaced, staged_file
from experiments.cli.workers import Executor
from experiments.feedforward.command import realistic_robot, variant_name
from experiments.identify.advice.report import ADVICE_HEAD, advice_rows
from experiments.identify.cases import MotionCases, default_cases, load_cases
from experiments.identify.closed_loop.drives import driven_motions
from experiments.identify.excitation import (
    designed_slow_motion,
    excitation_json,
    told_of,
    write_excitation,
)
from experiments.identify.fine_tuning.report import (
    MOTIONS_HEAD,
    NUMBERS_HEAD,
    motion_rows,
    number_rows,
)
from experiments.identify.fine_tuning.tuning import SHARE
from experiments.identify.judge.report import SUMMARY_HEAD, judge_summary
from experiments.identify.plots import table_head, table_rows, verdict, write_identify_page
from experiments.identify.recording_file import RECORDINGS, read_recording, write_recording
from experiments.identify.recording_map import Recording
from experiments.identify.recording_mcap import MCAP
from experiments.identify.search import (
    LEAST_EVALUATIONS,
    SEARCH_HEAD,
    check_pymoo,
    compare_searches,
    search_json,
    search_rows,
)
from experiments.identify.simulated import simulated_recording
from experiments.identify.slow import identify_slow_recording
from experiments.identify.study import (
    IdentifyStudy,
    identify_json,
    study_recording,
    with_advice,
    with_drives,
    with_fine_tuning,
    with_rectangle,
    with_verdict,
)
from experiments.report.files import write_text
from robots.description.model import RobotFileError, RobotModel, load_robot
from robots.description.robot_file import robot_text
from robots.threads import at_most
from systems.cell.drive import DriveConfig

# Options that say how to identify.
_NOT_EXCITED = ("plant", "gear_parts", "drives", "tuned_on_robot", "rectangle", "search")


def identify_command(
    context: typer.Context,
    robot: StudiedRobotOption = "kr210",
    cases: Annotated[
        Path | None,
        typer.Option(
            "--motions",
            metavar="FILE.yaml",
            help="Motions and sensors.",
            show_default="nine positions, two angles each",
        ),
    ] = None,
    recording: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="A recorded table (CSV, Parquet) or MCAP file.", show_default="simulated"
        ),
    ] = None,
    columns: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="What its columns are (YAML).", show_default="beside the table"),
    ] = None,
    slow: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Slow motions with torques, for load and friction: a table or the MCAP of a run.",
        ),
    ] = None,
    excite: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="Only design a slow motion, to be recorded for --slow, and write it.",
        ),
    ] = None,
    plant: Annotated[
        str | None,
        typer.Option(
            "--plant",
            metavar="NAME|FILE",
            help="What moves in the simulation, or was recorded, to compare with.",
            show_default="the realistic variant; unknown for a recording",
        ),
    ] = None,
    gear_parts: Annotated[
        bool, typer.Option(help="Gears may have play, hysteresis and ripple, or are linear.")
    ] = True,
    drives: Annotated[
        bool,
        typer.Option(
            "--drives",
            help="Refine drives, friction and dampers in closed loop; needs commands and torques.",
        ),
    ] = False,
    wants_verdict: Annotated[
        bool,
        typer.Option(
            "--judge",
            help="Then run the motions in the full nonlinear simulation, before and as identified.",
        ),
    ] = False,
    wants_advice: Annotated[
        bool,
        typer.Option(
            "--advise",
            help="Then look for further motions and sensors that would show what is not identifiable.",
        ),
    ] = False,
    tuned_on_robot: Annotated[
        bool,
        typer.Option(
            "--fine-tune",
            help="Then tune the inverse model on the robot, by how its tip follows a rectangle.",
        ),
    ] = False,
    tuning_share: Annotated[
        float,
        typer.Option(
            metavar="SHARE",
            help="Tuned numbers stay between this share of what was identified and its inverse.",
        ),
    ] = SHARE,
    rectangle: Annotated[
        bool, typer.Option(help="Drive a rectangle with the identified inverse model; needs --plant.")
    ] = True,
    search: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Compare with CMA-ES and a genetic algorithm, from N starts off by a factor of two.",
        ),
    ] = None,
    search_evaluations: Annotated[
        int, typer.Option(metavar="N", help="Of the model, for each of these.")
    ] = 1500,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of simulated noise and of searches.")] = 0,
    write: Annotated[
        Path | None,
        typer.Option(metavar="FILE.yaml", help="The identified robot, for --robot of every command."),
    ] = None,
    write_table: Annotated[
        Path | None,
        typer.Option(
            "--write-recording",
            metavar="FILE",
            help="Keep what was simulated, for --recording: .csv, .parquet, .mcap.",
        ),
    ] = None,
    report: PictureOption = Path("out/identify.html"),
    json_file: JsonOption = None,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
) -> None:
    """Identify stiffness and damping from short motions, gyros and accelerometers."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        refuse_given(context, () if search else ("search_evaluations",), "without --search")
        refuse_given(context, () if tuned_on_robot else ("tuning_share",), "without --fine-tune")
        at_least("--jobs", 1, jobs)
        at_least("--seed", 0, seed)
        at_least("--search", 1, search)
        at_least("--search-evaluations", LEAST_EVALUATIONS, search_evaluations)
        if recording is not None and (cases is not None or write_table is not None):
            raise ValueError(
                "--recording is what was recorded: no --motions and no --write-recording go with it"
            )
        if excite is not None and any((recording, cases, slow, write, write_table)):
            raise ValueError(
                "--excite only designs a motion: no recording, no motions and no --write go with it"
            )
        if excite is not None and (wants_advice or wants_verdict):
            raise ValueError("--excite only designs a motion: there is nothing to --judge or to --advise")
        if excite is not None:
            refuse_given(context, _NOT_EXCITED, "with --excite, which only designs a motion")
        if not 0.0 < tuning_share < 1.0:
            raise ValueError(f"--tuning-share must be between 0 and 1, got {tuning_share:g}")
        if tuned_on_robot and recording is not None and plant is None:
            raise ValueError("--fine-tune needs a robot to drive: say what was recorded by --plant NAME|FILE")
        if recording is None and slow is not None:
            raise ValueError("--slow adds slow motions to those of a --recording, and there is none")
        if recording is None and columns is not None:
            raise ValueError("--columns says what a --recording has, and there is none")
        model = noted_robot(human, robot)
        if excite is not None:
            slow_table = stack.enter_context(staged_file(excite, *TABLE))
            stack.enter_context(output.staged())
            with human.status("Designing the motion"):
                excitation = designed_slow_motion(model, seed)
            write_excitation(slow_table, excitation)
            output.write(excitation_json(excitation))
            human.print(escape(told_of(excitation)))
            print_files(human, excite)
            return
        truth = _plant(robot, plant, recording is not None)
        where = executor(scheduler, jobs)
        stack.enter_context(at_most(jobs))  # what this process itself computes in threads
        if search is not None:
            check_pymoo()
        page = stack.enter_context(staged_file(report, *PAGE))
        robot_file = stack.enter_context(staged_file(write, *YAML)) if write else None
        table = stack.enter_context(staged_file(write_table, *RECORDINGS)) if write_table else None
        if write_table and write_table.suffix.lower() != MCAP:  # a table has a map of its columns beside it
            refuse_replaced(write_table.parent, f"{write_table.stem}.yaml")
        stack.enter_context(output.staged())
        if recording is not None:
            recorded = read_recording(recording, columns)
        else:
            assert truth is not None
            motions = load_cases(cases, model) if cases else default_cases(model)
            recorded = _simulated(model, truth, motions, seed, where)
            if table:
                write_recording(table, recorded)
        if drives:
            driven_motions(recorded)  # refuses before the identification takes its time
        of_slow = identify_slow_recording(slow, model, recorded.payload) if slow else None
        with progress_bar(f"identification from {count(len(recorded.cases), 'motion')}") as progress:
            study = study_recording(model, truth, recorded, gear_parts, of_slow, progress)
        if drives:
            of_plant = None if recording is not None else DriveConfig()
            with progress_bar("drives in closed loop") as progress:
                study = with_drives(study, recorded, DriveConfig(), of_plant, progress)
        if wants_verdict:
            with progress_bar("full simulation as the judge") as progress:
                study = with_verdict(study, recorded, where, progress)
        if wants_advice:
            with progress_bar("further motions and sensors") as progress:
                study = with_advice(study, where, progress)
        if tuned_on_robot:
            with progress_bar("fine tuning on the robot") as progress:
                study = with_fine_tuning(study, where, tuning_share, seed, progress)
        if rectangle and truth is not None:
            with progress_bar("rectangle") as progress:
                study = with_rectangle(study, where, progress)
        searches = None
        if search is not None:
            with progress_bar(f"searches from {count(search, 'start')}") as progress:
                searches = compare_searches(study, search, search_evaluations, seed, where, progress)
        write_identify_page(page, study, searches)
        if robot_file and write:
            write_text(robot_file, robot_text(study.final, beside=Path(write)))
        numbers = identify_json(study) | ({"searches": search_json(searches)} if searches else {})
        output.write(with_assumed(numbers, model))
    _print(human, study)
    if study.verdict is not None:
        print_table(human, _table(SUMMARY_HEAD, judge_summary(study.verdict)))
    if study.advice is not None and study.advice.weak:
        print_table(human, _table(ADVICE_HEAD, advice_rows(study.advice)))
    if study.fine_tuning is not None:
        print_table(human, _table(MOTIONS_HEAD, motion_rows(study.fine_tuning)))
        tuned = number_rows(study.fine_tuning)[: len(study.fine_tuning.changed)]  # the page has the others
        print_table(human, _table(NUMBERS_HEAD, tuned))
    if searches:
        print_table(human, _table(SEARCH_HEAD, search_rows(searches)))
    print_files(human, report, write, write_table)


def _plant(robot: str, plant: str | None, is_recorded: bool) -> RobotModel | None:
    if plant is not None:
        return load_robot(plant)
    if is_recorded:
        return None
    realistic = realistic_robot(robot)
    if realistic is None:
        raise RobotFileError(
            f"robot '{robot}' has no variant named {variant_name(robot)}: say what moves by --plant "
            "NAME|FILE, or give a --recording"
        )
    return realistic


def _simulated(
    model: RobotModel, truth: RobotModel, motions: MotionCases, seed: int, where: Executor
) -> Recording:
    with progress_bar(f"recording of {count(len(motions.planned(model)), 'motion')}") as progress:
        return simulated_recording(model, truth, motions, seed, where, progress)


def _print(human: Console, study: IdentifyStudy) -> None:
    print_table(human, _table(table_head(study), table_rows(study)))
    human.print(escape(verdict(study)))


def _table(head: list[str], rows: list[list[str]]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in head:
        left = name in ("parameter", "unit", "method", "number", "motion", "sensors", "known by")
        table.add_column(name, justify="left" if left else "right", no_wrap=True)
    for row in rows:
        table.add_row(*map(escape, row))
    return table
