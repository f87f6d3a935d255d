"""``truetip doctor``: what this machine has, and how to get what is missing."""

from dataclasses import asdict

import typer
from rich import box
from rich.markup import escape
from rich.table import Table

from experiments.cli.console import refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.options import JsonOption
from experiments.doctor.checks import BAD, GOOD, OPTIONAL, findings

_COLORS = {GOOD: "green", OPTIONAL: "yellow", BAD: "red"}


def doctor_command(json_file: JsonOption = None) -> None:
    """Look at versions, cores, timers, ports and optional parts, and say how to get what is missing."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(OSError), output.staged():
        found = list(findings())
        output.write([asdict(each) for each in found])
    table = Table(box=box.SIMPLE, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column()
    for each in found:
        text = f"{each.found}; {each.advice}" if each.advice else each.found
        table.add_row(f"[{_COLORS[each.state]}]{each.state}[/]", escape(each.name), escape(text))
    human.print(table)
    missing = [each.name for each in found if each.state == BAD]
    human.print(f"Missing: {', '.join(missing)}" if missing else "Everything that is needed is there.")
    if missing:
        raise typer.Exit(1)
