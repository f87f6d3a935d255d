"""``truetip feedforward``: three inverse models on one elastic robot, compared."""

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.comparison.metrics import json_text, write_json
from experiments.feedforward.plots import TABLE_HEAD, study_verdict, table_rows, write_study_page
from experiments.feedforward.study import (
    ANGLES_DEG,
    KINDS,
    FeedforwardStudy,
    study_feedforward,
    study_json,
)
from experiments.terminal.console import count, progress_bar, refusing
from experiments.terminal.staging import staged_file
from experiments.terminal.workers import usable_cores
from robots.model import load_robot
from systems.feedforward import FeedforwardConfig

PAGE = "feedforward.html"


def feedforward_command(
    robot: Annotated[
        str, typer.Option("--robot", metavar="NAME|FILE", help="A shipped robot or a YAML file.")
    ] = "kr16",
    payload: Annotated[
        float | None,
        typer.Option(metavar="KG", help="Mass at the flange.", show_default="the largest it may carry"),
    ] = None,
    grid: Annotated[int, typer.Option(metavar="N", help="Positions of axis 2, and of axis 3.")] = 7,
    stiffness_error: Annotated[
        float,
        typer.Option(metavar="SHARE", help="By which the models' springs and dampers are too stiff."),
    ] = 0.0,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the pictures go.")] = Path("out"),
    json_file: Annotated[
        str | None,
        typer.Option("--json", metavar="FILE", help="The numbers; - prints them, and nothing else."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(metavar="N", help="Processes at a time.", show_default="one per core")
    ] = None,
) -> None:
    """Compare inverse models: a rectangle in space, and how the wrist rings after short motions."""
    human = Console(stderr=json_file == "-")
    with refusing(ValueError, OSError), ExitStack() as stack:
        if jobs is not None and jobs < 1:
            raise ValueError(f"--jobs must be at least 1, got {jobs}")
        model = load_robot(robot)
        mass = model.payload.largest_mass if payload is None else payload
        page = stack.enter_context(staged_file(out / PAGE))
        copy = stack.enter_context(staged_file(json_file)) if json_file not in (None, "-") else None
        runs = len(KINDS) * (1 + len(ANGLES_DEG) * grid * grid)
        processes = min(jobs or usable_cores(), max(runs, 1))
        label = f"{count(runs, 'run')} in {count(processes, 'process', 'processes')}"
        with progress_bar(label) as progress:
            config = FeedforwardConfig(stiffness_error=stiffness_error)
            study = study_feedforward(model, mass, config, grid, processes, progress)
        write_study_page(page, study)
        if copy:
            write_json(copy, study_json(study))
    if json_file == "-":
        sys.stdout.write(json_text(study_json(study)))
    human.print(_table(study))
    human.print(escape(study_verdict(study)))
    human.print(escape(str(out / PAGE)), soft_wrap=True)


def _table(study: FeedforwardStudy) -> Table:
    title = f"{study.robot.name}, {study.payload:g} kg: deviation from a rectangle, relative to rigid"
    table = Table(box=box.SIMPLE_HEAD, title=escape(title), title_justify="left", title_style="italic")
    for name in TABLE_HEAD:
        table.add_column(name, justify="left" if name == TABLE_HEAD[0] else "right", no_wrap=True)
    for row in table_rows(study):
        table.add_row(*row)
    return table
