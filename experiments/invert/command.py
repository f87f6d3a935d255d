"""``truetip invert``: how much a robot still rings with the stable inverse, and with causal ones."""

from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.markup import escape
from rich.table import Table

from experiments.cli.console import count, print_files, print_table, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, refuse_given
from experiments.cli.options import (
    GridOption,
    JobsOption,
    JsonOption,
    PayloadOption,
    PictureOption,
    StudiedRobotOption,
)
from experiments.cli.prepare import noted_robot, with_assumed
from experiments.cli.staging import PAGE, staged_file
from experiments.invert.plots import TABLE_HEAD, refusals, table_rows, verdict, write_invert_page
from experiments.invert.study import KINDS, InvertStudy, invert_json, study_inverses
from robots.threads import usable_cores


def invert_command(
    context: typer.Context,
    robot: StudiedRobotOption = "kr210",
    payload: PayloadOption = None,
    angle: Annotated[float, typer.Option(metavar="DEG", help="By which axes 1 to 3 turn.")] = 5.0,
    grid: GridOption = 2,
    spring_error: Annotated[
        float, typer.Option(metavar="SHARE", help="Every spring of the true robot is up to so much off.")
    ] = 0.0,
    seeds: Annotated[int, typer.Option(metavar="N", help="How many robots with such springs.")] = 1,
    rehearse: Annotated[
        bool,
        typer.Option(
            "--rehearse", help="Also make each motion once to learn the springs from the motors' torques."
        ),
    ] = False,
    out: PictureOption = Path("out/invert.html"),
    json_file: JsonOption = None,
    jobs: JobsOption = None,
) -> None:
    """Compare the stable inverse, which moves the motors before the tip, with causal inverse models."""
    human = human_console(json_file)
    with (
        json_output(json_file) as output,
        refusing(ValueError, OSError),
        staged_file(out, *PAGE) as page,
        output.staged(),
    ):
        at_least("--jobs", 1, jobs)
        refuse_given(
            context, () if spring_error else ("seeds",), "without --spring-error: all robots are the same"
        )
        model = noted_robot(human, robot)
        mass = model.payload.largest_mass if payload is None else payload
        runs = max(1, (len(KINDS) + rehearse) * grid * grid * (seeds if spring_error else 1))
        processes = min(jobs or usable_cores(), runs)
        label = f"{count(runs, 'run')} in {count(processes, 'process', 'processes')}"
        with progress_bar(label) as progress:
            study = study_inverses(
                model, mass, angle, grid, spring_error, seeds, processes, progress, rehearse
            )
        write_invert_page(page, study)
        output.write(with_assumed(invert_json(study), model))
    print_table(human, _table(study))
    for line in [verdict(study), *refusals(study)]:
        human.print(escape(line))
    print_files(human, out)


def _table(study: InvertStudy) -> Table:
    title = f"{study.robot.name}, {study.payload:g} kg: the wrist after {study.angle_deg:g} degrees"
    table = Table(box=box.SIMPLE_HEAD, title=escape(title), title_justify="left", title_style="italic")
    for name in TABLE_HEAD:
        is_first = name == TABLE_HEAD[0]
        table.add_column(name, justify="left" if is_first else "right", no_wrap=not is_first)
    for row in table_rows(study):
        table.add_row(*row)
    return table
