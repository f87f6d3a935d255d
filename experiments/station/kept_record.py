"""The record of what a station says, where it stays."""

from contextlib import ExitStack
from pathlib import Path

import typer

from diagrams.record.run_record import RunRecord
from experiments.cli.command_table import stays
from experiments.cli.staging import make_folder_of


def kept_record(stack: ExitStack, path: Path, text: str) -> RunRecord:
    """A record that lasts as long as a stack, and says in the end if not all could be written.

    What is only moved to its place in the end is lost with the process.

    Args:
        stack: closes it.
        path: of the file, which is replaced.
        text: the scenario.

    Raises:
        OSError: if the file cannot be written.
    """
    make_folder_of(path)
    record = RunRecord(path, text)
    stays(path)

    def close() -> None:
        record.close()
        if record.problem:
            typer.echo(f"truetip: {record.problem}", err=True)

    stack.callback(close)
    return record


def next_part(path: Path) -> Path:
    """The name of the next part of a record, where there are parts already: run.mcap, run-2.mcap, ..."""
    number, part = 1, path
    while part.exists():
        number += 1
        part = path.with_stem(f"{path.stem}-{number}")
    return part
