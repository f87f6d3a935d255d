"""What all commands share: refusals in one line, progress bars, lists, tables."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from experiments.cli.command_table import option_with, staying
from experiments.cli.ending import exit_code
from experiments.cli.workers import SimulationError
from systems.named_classes import place_in_own_file

BAD_INPUT, BROKEN_OFF = 2, 1  # exit codes
_NARROWEST = 12  # characters of a text that a line of a table has at least
_OBSERVED, _LONG = 2.0, 20.0  # s: of progress before a time is said; what is worth a line


@contextmanager
def refusing(*refusals: type[Exception]) -> Iterator[None]:
    """Turns what the user can mend into one line and an exit code; a defect still shows itself."""
    try:
        yield
    except refusals as error:
        fail(_plain(error), BAD_INPUT)
    except SimulationError as error:
        fail(str(error), BROKEN_OFF)
    except KeyboardInterrupt as error:
        kept = [str(file) for file in staying()]
        what = f"; kept: {', '.join(kept)}" if kept else ", nothing was written"
        fail(f"interrupted{what}", exit_code(error))
    except (Exception, SystemExit) as error:  # a file of one's own may raise anything
        if (place := place_in_own_file(error)) is None:
            raise
        fail(place, BAD_INPUT)


def _plain(error: Exception) -> str:
    """The message of an error; of one of the system the option and the file first, and no number."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        option = option_with(str(error.filename))
        return f"{option} {error.filename}: {error.strerror.lower()}".lstrip()
    return str(error)


def fail(message: str, code: int) -> None:
    """Says why in one line on stderr and ends the command."""
    typer.echo(f"truetip: {' '.join(message.split())}", err=True)
    raise typer.Exit(code)


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """A progress bar on stderr, where that is a terminal; gives the function that tells it the share done.

    After two seconds a line says how long it takes in all, if that is long.
    """
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(label, total=1.0)
        expected = Expected()

        def told(share: float) -> None:
            bar.update(task, completed=share)
            seconds = expected.seconds(share, time.monotonic())
            if console.is_terminal and seconds is not None and seconds > _LONG:
                bar.console.print(f"{label}: about {duration(seconds)} on this machine", highlight=False)

        yield told


class Expected:
    """How long something takes, said once, from the speed of its first seconds.

    The time before the first share is not counted: it goes to imports and compilers.
    """

    def __init__(self) -> None:
        """Nothing is known yet."""
        self._first: tuple[float, float] | None = None  # share and time in s
        self._said = False

    def seconds(self, share: float, now: float) -> float | None:
        """The whole time in s, after `_OBSERVED` seconds of progress; None before and later."""
        if self._said or not 0.0 < share < 1.0:
            return None
        if self._first is None:
            self._first = (share, now)
        at, since = self._first
        if now - since < _OBSERVED or share <= at:
            return None
        self._said = True
        return (now - since) / (share - at)


def duration(seconds: float) -> str:
    """A time as one says it: 40 s, 3 min, 2.5 h."""
    if seconds < 100.0:
        return f"{round(seconds, -1):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def print_note(console: Console, note: str) -> None:
    """What a person should know before they wait for it, if there is anything."""
    if note:
        console.print(f"Note: {note}", style="yellow", highlight=False)


def wait_for_interrupt(console: Console, message: str) -> None:
    """Says what goes on and lets it until Ctrl-C; on no terminal, where nobody presses it, ends at once."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return
    console.print(message)
    try:
        while True:
            time.sleep(1.0)
    except KeyboardInterrupt:
        console.print()


def print_files(console: Console, *files: str | Path | None) -> None:
    """Where the results are, a line each; None for a file that was not asked for."""
    for file in filter(None, files):
        console.print(escape(str(file)), soft_wrap=True)


def print_list(rows: Iterable[tuple[str, str]]) -> None:
    """Names with a line of text each."""
    table = Table(box=box.SIMPLE, show_header=False)
    table.add_column(no_wrap=True, style="bold")
    table.add_column()
    for name, text in rows:
        table.add_row(escape(name), escape(text))
    Console().print(table)


def print_table(console: Console, table: Table) -> None:
    """Prints a table with all its numbers whole.

    Texts are folded where a terminal or pipe is narrow. A number with its end cut off would be another
    number: columns that are justified right are as wide as their numbers, and the table is rather wider than
    a very narrow terminal.
    """
    least = 1
    for column in table.columns:
        head, *cells = (console.render_str(str(each)) for each in (column.header, *column.cells))
        widest = max((cell.cell_len for cell in cells), default=0)
        if column.justify == "right":
            words = [head.plain] if column.no_wrap else head.plain.split()
            column.min_width = max([widest, *(max(map(len, word.split("\n"))) for word in words)])
        else:
            column.no_wrap, column.overflow = False, "fold"
            column.min_width = min(max(widest, head.cell_len), _NARROWEST)
        least += column.min_width + table.padding[1] + table.padding[3] + 1
    table.width = least if least > console.width else None
    console.print(table, crop=False)


def count(number: int, one: str, many: str = "") -> str:
    """A number with its noun: 1 run, 12 runs."""
    return f"{number} {one if number == 1 else many or one + 's'}"
