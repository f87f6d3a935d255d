"""``truetip plan``: the quickest or most frugal motion within the limits of drives and gears."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.markup import escape
from rich.table import Table

from diagrams.scenario.scenario import StationConfig
from experiments.cli.console import print_files, print_note, print_table, progress_bar, refusing
from experiments.cli.ending import insisting
from experiments.cli.json_output import human_console, json_output
from experiments.cli.options import JsonOption, PayloadOption, StudiedRobotOption
from experiments.cli.prepare import noted_robot
from experiments.cli.staging import PAGE, TABLE, staged_file, staged_folder
from experiments.plan.plots import TABLE_HEAD, table_rows, verdict, write_plan_page
from experiments.plan.program_option import check_language, program_files
from experiments.plan.results import joint_table, plan_json
from experiments.plan.study import OBJECTIVES, LegResult, Plan, study_plan
from experiments.report.files import write_text
from robots.description.model import RobotModel, load_robot
from robots.kinematics.forward import Kinematics
from robots.measurement_design.obstacles import read_obstacles
from robots.planning.limits import DUTY, RESERVE, motion_limits
from robots.planning.path_dynamics import DYNAMICS
from robots.programs.planned_moves import FILES, MOVES
from robots.programs.read import unit_in_doubt
from systems.reference.planned_file import planned_text


def plan_command(
    path: Annotated[
        str,
        typer.Option(
            "--path",
            metavar="rectangle|joints|FILE",
            help="A level rectangle; axes 1 to 3 from zero to -20 degrees; or a table, RAPID or "
            "KRL, with a rest at the end of each move.",
        ),
    ] = "rectangle",
    others: Annotated[
        list[Path] | None,
        typer.Option("--with", metavar="FILE", help="Declares what a program does not. Repeatable."),
    ] = None,
    objective: Annotated[
        str,
        typer.Option(
            metavar="|".join(OBJECTIVES),
            help="Least time, least energy in the time of the usual timing, or energies for several times.",
        ),
    ] = "time",
    dynamics: Annotated[
        str, typer.Option(metavar="|".join(DYNAMICS), help="What the planner knows to yield.")
    ] = "elastic_structure",
    robot: StudiedRobotOption = "kr16",
    payload: PayloadOption = None,
    plant: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE", help="What the motion is tried on.", show_default="the robot itself"
        ),
    ] = None,
    recuperation: Annotated[
        bool, typer.Option("--recuperation", help="Motors that brake give energy back to the others.")
    ] = False,
    tool_speed: Annotated[
        float, typer.Option(metavar="M/S", help="Largest speed of the tool.", show_default="no limit")
    ] = float("inf"),
    tool_acceleration: Annotated[
        float,
        typer.Option(metavar="M/S^2", help="Largest acceleration of the tool.", show_default="no limit"),
    ] = float("inf"),
    duty: Annotated[
        float,
        typer.Option(metavar="SHARE", help="Share of a cycle that is motion, for the heat of the motors."),
    ] = DUTY,
    may_ring: Annotated[
        bool,
        typer.Option("--may-ring", help="No time or energy is given away to ring as little as usual."),
    ] = False,
    reserve: Annotated[
        float,
        typer.Option(metavar="SHARE", help="Of every limit, left for a law that corrects the motion."),
    ] = RESERVE,
    free: Annotated[
        bool,
        typer.Option("--free", help="From rest to rest the joints go the way that is quickest."),
    ] = False,
    obstacles: Annotated[
        str | None,
        typer.Option(metavar="FILE.yaml", help="Boxes that the arm keeps clear of on a free way."),
    ] = None,
    write: Annotated[
        str | None, typer.Option(metavar="FILE.csv", help="The motion, for reference.path=!Planned.")
    ] = None,
    program: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(MOVES),
            help="The motions as a program beside the page, timed as controllers do.",
        ),
    ] = None,
    report: Annotated[Path, typer.Option("--report", metavar="FILE.html", help="The picture.")] = Path(
        "out/plan.html"
    ),
    json_file: JsonOption = None,
) -> None:
    """Plan the quickest or most frugal motion within limits of drives and gears, and try it in the plant."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        check_language(program)
        if program and free:
            raise ValueError("--program has no move for a free way; leave out --free or use --write")
        if obstacles and not free:
            raise ValueError("--obstacles counts on free ways only; give --free too")
        boxes = read_obstacles(obstacles) if obstacles else ()
        model = noted_robot(human, robot)
        print_note(human, unit_in_doubt(path))
        mass = model.payload.largest_mass if payload is None else payload
        limits = motion_limits(model, tool_speed, tool_acceleration, duty).with_reserve(reserve)
        true = None if plant is None else load_robot(plant)
        plan = Plan(
            model,
            mass,
            path,
            objective,
            dynamics,
            limits,
            recuperation,
            true,
            may_ring,
            free,
            boxes,
            reserve > 0.0,
            tuple(map(str, others or [])),
        )
        page = stack.enter_context(staged_file(report, *PAGE))
        table = stack.enter_context(staged_file(write, *TABLE)) if write else None
        code = stack.enter_context(staged_folder(report.parent, FILES[program])) if program else None
        written: list[Path] = []
        stack.enter_context(output.staged())
        with progress_bar(f"{objective}, {dynamics}") as progress, insisting():
            results = study_plan(plan, progress)
        write_plan_page(page, plan, results)
        if table:
            write_text(table, _motion_text(model, results))
        if code:
            files = program_files(str(program), model, results)
            for name, text in files.items():
                write_text(code / name, text)
            written += [report.parent / name for name in files]
        output.write(plan_json(plan, results))
    aim = "least time, then energies" if objective == "front" else f"least {objective}"
    title = f"{model.name}, {mass:g} kg: {path}, {aim}"
    print_table(human, result_table(title, table_rows(plan, results)))
    human.print(escape(verdict(plan, results)))
    print_files(human, report, write, *written)


def _motion_text(robot: RobotModel, results: list[LegResult]) -> str:
    times, q = joint_table(results, 0.5 * StationConfig().period)
    return planned_text(times, Kinematics(robot).forward(q), q)


def result_table(title: str, rows: list[list[str]]) -> Table:
    """A line for each leg.

    Args:
        title: above them.
        rows: of `experiments.plan.plots.table_rows`.
    """
    heads = TABLE_HEAD[:-1]
    table = Table(box=box.SIMPLE_HEAD, title=escape(title), title_justify="left", title_style="italic")
    for name in heads:
        table.add_column(name, justify="left" if name == heads[0] else "right", no_wrap=True)
    for row in rows:
        table.add_row(*map(escape, row[:-1]))
    return table
