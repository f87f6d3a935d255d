"""The table of Probst (2024), 6.7, on a terminal: largest and static error per axis, for every law."""

import math
from collections.abc import Mapping
from typing import Any

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.cli.console import BROKEN_OFF, print_table
from experiments.metrics.laps import SLOWED
from experiments.report.error_rows import AXES, KINDS, error_row, format_cell, is_best, smallest_of_columns
from experiments.report.style import law_colors, law_title

SOURCES = {"true": "true, what a perfect instrument would see", "measured": "measured, what the camera says"}

_SHOWN = {
    "m": (1e3, "mm"),
    "rad": (180.0 / math.pi, "°"),
    "s": (1e3, "ms"),
    "s/s": (1e6, "ppm"),
    "1": (100.0, "%"),
}


def print_summary(console: Console, result: Mapping[str, Any]) -> None:
    """Prints the true and the measured errors of a `metrics.summary`, and what the guard did."""
    console.print()
    console.print(f"[bold]Scenario {escape(result['scenario'])}[/bold]")
    if early := [law_title(law) for law, run in result["runs"].items() if "unfinished" in run]:
        console.print(f"[red]Did not come to the end of its path: {escape(', '.join(early))}[/red]")
    for source in SOURCES:
        print_table(console, error_table(result, source))
    if any("laps" in run for run in result["runs"].values()):
        print_table(console, lap_table(result))
    for law, run in result["runs"].items():
        if line := slowed_line(run):
            console.print(f"[italic]{escape(law_title(law))}: {line}[/italic]")
        for line in learnt_lines(run.get("learnt") or {}):
            console.print(f"[italic]{escape(law_title(law))}: {escape(line)}[/italic]")
    if any(count for run in result["runs"].values() for count in run["guard"].values()):
        print_table(console, guard_table(result))
    else:
        console.print("[italic]Guard: no intervention[/italic]\n")


def conclude(result: Mapping[str, Any]) -> None:
    """Names on stderr the runs of a summary that did not come to their end, and then ends the command.

    Raises:
        typer.Exit: with the code of runs that broke off.
    """
    endings = {law: run["unfinished"] for law, run in result["runs"].items() if "unfinished" in run}
    for law, ending in endings.items():
        typer.echo(f"truetip: law {law}: {ending}", err=True)
    if endings:
        raise typer.Exit(BROKEN_OFF)


def error_table(result: Mapping[str, Any], source: str) -> Table:
    """The errors of one source; the smallest number of each column and kind is bold."""
    table = Table(
        box=box.SIMPLE_HEAD,
        title=f"Errors, {SOURCES[source]}",
        title_justify="left",
        title_style="italic",
        padding=(0, 1, 0, 0),  # so that 80 characters are enough for all laws
    )
    table.add_column("error", no_wrap=True)
    table.add_column("law", no_wrap=True)
    for axis in AXES:
        table.add_column(axis, justify="right", no_wrap=True)
    colors = law_colors(result["runs"])
    for kind, kind_title in KINDS.items():
        rows = {law: error_row(run[source], kind) for law, run in result["runs"].items()}
        smallest = smallest_of_columns(list(rows.values()))
        for number, (law, row) in enumerate(rows.items()):
            cells = [
                f"[bold]{format_cell(value)}[/bold]" if is_best(value, best) else format_cell(value)
                for value, best in zip(row, smallest, strict=True)
            ]
            name = f"[{colors[law]}]{escape(law_title(law))}[/]"
            table.add_row(
                kind_title if number == 0 else "", name, *cells, end_section=number == len(rows) - 1
            )
    return table


def lap_table(result: Mapping[str, Any]) -> Table:
    """The largest distance and angle of each lap."""
    runs = result["runs"]
    table = Table(
        box=box.SIMPLE_HEAD, title="Laps, largest error", title_justify="left", title_style="italic"
    )
    table.add_column("law", no_wrap=True)
    for number in range(max(len(run.get("laps", [])) for run in runs.values())):
        table.add_column(f"{number + 1}: mm", justify="right", no_wrap=True)
        table.add_column("°", justify="right", no_wrap=True)
    colors = law_colors(runs)
    for law, run in runs.items():
        cells = [
            format_cell(lap[name]) for lap in run.get("laps", []) for name in ("max_norm_mm", "max_angle_deg")
        ]
        table.add_row(f"[{colors[law]}]{escape(law_title(law))}[/]", *cells)
    return table


def slowed_line(run: Mapping[str, Any]) -> str:
    """How many times as long as planned a run took for its path; empty if no longer."""
    whole = run.get("times_planned")
    if whole is None or whole <= SLOWED:
        return ""
    laps = [lap["times_planned"] for lap in run.get("laps", [])]
    each = f" (laps: {', '.join(map(format_cell, laps))})" if laps else ""
    return f"the path took {format_cell(whole)} times as long as planned{each}"


def learnt_lines(learnt: Mapping[str, Any]) -> list[str]:
    """What a law says of what it knows of its path, and of what has happened to the robot."""
    lines = []
    if path := learnt.get("path"):
        before, now = path["before"], path["now"]
        when, what = before["time_s"], before["parameter"]
        off = _in_units(2.0 * before["parameter_sigma"], before["unit"])
        lines.append(
            f"half a second ahead the tip was expected to be known to {2e3 * before['tip_sigma_m']:.3f} mm, "
            f"least at {when:.1f} s and most because of {what}, which may be off by {off}; "
            f"in the end it is known to {2e3 * now['tip_sigma_m']:.3f} mm (2 sigma)"
        )
    for event in learnt.get("events", []):
        lines.append(f"{event['time_s']:.2f} s: {event['kind']}, {_in_units(event['size'], event['unit'])}")
    return lines


def _in_units(value: float, unit: str) -> str:
    """A value as people read it: mm, degrees, ms and ppm in place of m, rad, s and s/s."""
    factor, shown = _SHOWN.get(unit, (1.0, unit))
    return f"{factor * value:.3g} {shown}".rstrip()


def guard_table(result: Mapping[str, Any]) -> Table:
    """How often the guard intervened, by kind."""
    kinds = sorted({kind for run in result["runs"].values() for kind, count in run["guard"].items() if count})
    title = "Guard, ticks with an intervention"
    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left", title_style="italic")
    table.add_column("law", no_wrap=True)
    for kind in kinds:
        table.add_column(escape(kind.replace("_", " ")), justify="right")
    for law, run in result["runs"].items():
        table.add_row(escape(law_title(law)), *(str(run["guard"].get(kind, 0)) for kind in kinds))
    return table
