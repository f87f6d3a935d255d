"""``truetip feedforward``: three inverse models on one elastic robot, compared."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.markup import escape
from rich.table import Table

from experiments.cli.console import count, print_files, print_table, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, one_of
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
from experiments.feedforward.plots import TABLE_HEAD, study_verdict, table_rows, write_study_page
from experiments.feedforward.study import (
    ANGLES_DEG,
    KINDS,
    PLANTS,
    FeedforwardStudy,
    study_feedforward,
    study_json,
)
from robots.description.model import RobotFileError, RobotModel, load_robot, shipped_robots
from robots.threads import usable_cores
from systems.feedforward import FeedforwardConfig


def feedforward_command(
    robot: StudiedRobotOption = "kr16",
    payload: PayloadOption = None,
    grid: GridOption = 4,  # 7 takes 2.4 times as long, for medians that are within a twelfth
    plant: Annotated[
        str | None,
        typer.Option(
            "--plant",
            metavar="|".join(PLANTS),
            help="What is driven: the robot of the models, or the one named after it with -realistic.",
            show_default="realistic, where there is such a file",
        ),
    ] = None,
    stiffness_error: Annotated[
        float,
        typer.Option(
            metavar="SHARE", help="Relative error of the models' springs and dampers; positive is too stiff."
        ),
    ] = 0.0,
    smooth: Annotated[
        bool,
        typer.Option(
            help="Motions with five continuous derivatives, or sin^2 acceleration, whose fourth one jumps."
        ),
    ] = True,
    report: PictureOption = Path("out/feedforward.html"),
    json_file: JsonOption = None,
    jobs: JobsOption = None,
) -> None:
    """Compare inverse models: a rectangle in space, and how the wrist rings after short motions."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        at_least("--jobs", 1, jobs)
        one_of("--plant", PLANTS, plant)
        model, realistic = noted_robot(human, robot), _driven(robot, plant)
        mass = model.payload.largest_mass if payload is None else payload
        page = stack.enter_context(staged_file(report, *PAGE))
        stack.enter_context(output.staged())
        runs = len(KINDS) * (2 + len(ANGLES_DEG) * grid * grid)
        processes = min(jobs or usable_cores(), max(runs, 1))
        label = f"{count(runs, 'run')} in {count(processes, 'process', 'processes')}"
        with progress_bar(label) as progress:
            config = FeedforwardConfig(stiffness_error=stiffness_error)
            timing = "polynomial" if smooth else "sine_squared"
            study = study_feedforward(model, mass, config, grid, processes, progress, realistic, timing)
        write_study_page(page, study)
        output.write(with_assumed(study_json(study), model))
    print_table(human, _table(study))
    human.print(escape(study_verdict(study)))
    print_files(human, report)


def _driven(name: str, plant: str | None) -> RobotModel | None:
    """The realistic variant where it is asked for, or nothing is said and there is one; else None."""
    if plant == "exact":
        return None
    realistic = realistic_robot(name)
    if realistic is None and plant is not None:
        raise RobotFileError(
            f"--plant realistic: there is no file {variant_name(name)}; --plant exact needs no other file"
        )
    return realistic


def realistic_robot(name: str) -> RobotModel | None:
    """The realistic variant of a robot: the file that is named after it; None if there is none.

    Raises:
        RobotFileError: if that file is no valid robot.
    """
    variant = variant_name(name)
    is_there = variant in shipped_robots() or (Path(variant).suffix and Path(variant).is_file())
    return load_robot(variant) if is_there else None


def variant_name(name: str) -> str:
    """What the file of the realistic variant of a robot is called."""
    stem = name.removesuffix(".yaml").removesuffix(".yml").removesuffix(".urdf")
    return f"{stem}-realistic{name[len(stem) :]}"


def _table(study: FeedforwardStudy) -> Table:
    title = (
        f"{study.robot.name}, {study.payload:g} kg, {study.plant} plant: deviation from a rectangle "
        f"of {study.edges[0]:.2f} by {study.edges[1]:.2f} m, relative to rigid"
    )
    table = Table(box=box.SIMPLE_HEAD, title=escape(title), title_justify="left", title_style="italic")
    for name in TABLE_HEAD:
        # Units below the names: eighty columns are few.
        justify = "left" if name == TABLE_HEAD[0] else "right"
        table.add_column(name.replace(" ", "\n"), justify=justify, no_wrap=True)
    for row in table_rows(study):
        table.add_row(*row)
    return table
