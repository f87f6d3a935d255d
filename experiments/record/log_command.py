"""``truetip log``: what stands in the record of a run, and its export."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from diagrams.record.read_record import Contents, Topic, read_record
from diagrams.record.run_record import PATH
from experiments.cli.console import print_files, print_table, refusing
from experiments.cli.staging import staged_file, staged_folder


def log_command(
    file: Annotated[Path, typer.Argument(metavar="FILE.mcap", help="Record of a run.")],
    csv: Annotated[Path | None, typer.Option(metavar="DIR", help="A table for each topic, as CSV.")] = None,
    parquet: Annotated[
        Path | None, typer.Option(metavar="DIR", help="A table for each topic, as Parquet.")
    ] = None,
    npz: Annotated[Path | None, typer.Option(metavar="FILE.npz", help="All topics as numpy arrays.")] = None,
) -> None:
    """Summarise the record of a run, also one that was cut off, and export it."""
    with refusing(ValueError, OSError), ExitStack() as stack:
        contents = read_record(file)
        folder = stack.enter_context(staged_folder(csv)) if csv else None
        tables = stack.enter_context(staged_folder(parquet)) if parquet else None
        arrays = stack.enter_context(staged_file(npz, ".npz")) if npz else None
        for name, topic in contents.topics.items():
            stem = name.strip("/").replace("/", "-")
            if folder:
                write_csv(folder / f"{stem}.csv", topic)
            if tables:
                write_parquet(tables / f"{stem}.parquet", topic)
        if arrays:
            columns: dict[str, Any] = as_arrays(contents)
            np.savez_compressed(arrays, **columns)
    console = Console()
    said = contents.run
    how = str(said.get("ended", "no run of a law"))
    if how == PATH:
        how = "ran its path to the end"
    if not contents.is_complete:
        how = f"was cut off: it {contents.cut or 'ends behind its last message'}"
        how += "; what follows is what is there" if contents.topics else ""
    law = f"law {said['law']}, " if "law" in said else ""
    console.print(escape(f"{file}: {law}{how}"), soft_wrap=True)
    if contents.topics:
        print_table(console, summary_table(contents))
    print_files(console, csv, parquet, npz)


def summary_table(contents: Contents) -> Table:
    """Messages, times and rates of all topics."""
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("topic", no_wrap=True)
    for name in ("messages", "from", "to", "rate", "longest gap"):
        table.add_column(name, justify="right", no_wrap=True)
    for name, topic in sorted(contents.topics.items()):
        count, gaps = len(topic.time), np.diff(topic.time)
        span = float(topic.time[-1] - topic.time[0])
        table.add_row(
            name,
            str(count),
            f"{topic.time[0]:.3f} s",
            f"{topic.time[-1]:.3f} s",
            f"{(count - 1) / span:.1f} Hz" if span > 0.0 else "-",
            f"{1e3 * gaps.max():.1f} ms" if count > 1 else "-",
        )
    return table


def as_arrays(contents: Contents) -> dict[str, np.ndarray]:
    """All columns by topic and field: ``joint_sample.position``, with ``joint_sample.time`` in s."""
    found = {}
    for name, topic in contents.topics.items():
        prefix = name.strip("/").replace("/", ".")
        found[f"{prefix}.time"] = topic.time
        for column, values in topic.columns.items():
            found[f"{prefix}.{column}"] = values.astype(str) if values.dtype == object else values
    return found


def write_csv(path: Path, topic: Topic) -> None:
    """A topic as a table; a column of several numbers becomes several columns."""
    columns = _table(topic)
    rows = zip(*(values.astype(object) for values in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(_cell(value) for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_parquet(path: Path, topic: Topic) -> None:
    """The same table with its numbers in full."""
    columns = {
        name: values.astype(str) if values.dtype == object else values
        for name, values in _table(topic).items()
    }
    pq.write_table(pa.table(columns), path, compression="zstd")


def _table(topic: Topic) -> dict[str, np.ndarray]:
    """Columns of one number each, shape (n,)."""
    columns = {"time": topic.time}
    for column, values in topic.columns.items():
        width = values.shape[1]
        names = [column] if width == 1 else [f"{column}_{n}" for n in range(1, width + 1)]
        columns |= dict(zip(names, values.T, strict=True))
    return columns


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.12g}" if value == value else ""
    text = str(value)
    return '"' + text.replace('"', '""') + '"' if any(each in text for each in ',"\n') else text
