"""The table of a study on disk: written while it runs, whole at any moment, taken up again where it ended.

Finished rows go into small Parquet files beside the table. When the study is complete they become one
file in the order of the rows; until then every start reads what is there. A file appears under its name only
when it is complete, so a process that is killed leaves nothing half-written.
"""

import fcntl
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from experiments.cli.versions import installed_versions

TABLE, TIMES = "study.parquet", "times.parquet"
_PARTS, _PLAN = "parts", "plan.json"
_FLUSH = 2.0  # s, as much work is lost at most


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Keeps other processes from the same study, whose parts would replace one another; it makes the folder.

    Raises:
        ValueError: if one is at work there.
        OSError: if the folder cannot be made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    place = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ValueError(f"another process works on the study in {folder}: wait for it") from error
        yield
    finally:
        os.close(place)


class StudyStore:
    """The rows of one study in a folder.

    Args:
        folder: is made if it does not exist.
        plan: what identifies the study; a folder that holds another one is refused.
        columns: name -> "number", "text" or "count", in the order of the table.

    Raises:
        ValueError: if the folder holds rows of another study, of another version of truetip or Drake, or
            without their plan, or a damaged file; so do the methods that read.
        OSError: if it cannot be read or written.
    """

    def __init__(self, folder: Path, plan: Mapping[str, Any], columns: Mapping[str, str]) -> None:
        self._folder = folder
        self._schema = pa.schema([(name, _TYPES[kind]) for name, kind in columns.items()])
        self._part_schema = self._schema.append(_WALL_TIME)
        self._pending: list[dict[str, Any]] = []
        self._last_flush = time.monotonic()
        (folder / _PARTS).mkdir(parents=True, exist_ok=True)
        self._agree_on(dict(plan) | {"versions": installed_versions()})
        self._next_part = 1 + max((int(path.stem) for path in self._parts()), default=-1)

    def finished(self, with_failures: bool = True) -> set[int]:
        """Numbers of the rows that are there; those that failed only if wanted."""
        tables = [self._folder / TABLE] if (self._folder / TABLE).exists() else []
        rows: dict[int, str] = {}
        for path in (*tables, *self._parts()):
            found = _read(path, ["row", "failure"])
            rows |= dict(zip(found["row"].to_pylist(), found["failure"].to_pylist(), strict=True))
        return {row for row, failure in rows.items() if with_failures or not failure}

    def add(self, row: Mapping[str, Any]) -> None:
        """Takes a row; at least every 2 s what has come is on disk."""
        self._pending.append(dict(row))
        if time.monotonic() - self._last_flush > _FLUSH:
            self.flush()

    def flush(self) -> None:
        """Writes what has come since the last time."""
        self._last_flush = time.monotonic()
        if not self._pending:
            return
        table = pa.Table.from_pylist(self._pending, schema=self._part_schema)
        _write(table, self._folder / _PARTS / f"{self._next_part:06d}.parquet")
        self._next_part += 1
        self._pending = []

    def table(self) -> pa.Table:
        """All rows so far in their order; of a row that was done twice, the later result."""
        self.flush()
        return self._merged(TABLE, self._schema)

    def finish(self) -> pa.Table:
        """Makes one file of all parts and gives the table.

        Wall times are apart in ``times.parquet``: ``study.parquet`` is the same however often the study was
        interrupted, and on whatever machine it ran.
        """
        rows = self.table()
        times = self._merged(TIMES, pa.schema([self._part_schema.field("row"), _WALL_TIME]))
        _write(times, self._folder / TIMES)
        _write(rows, self._folder / TABLE)
        for path in self._parts():
            path.unlink()
        return rows

    def _merged(self, name: str, schema: pa.Schema) -> pa.Table:
        paths = [self._folder / name, *self._parts()]
        tables = [_read(path, schema.names) for path in paths if path.exists()]
        if not tables:
            return schema.empty_table()
        rows = pa.concat_tables(tables)
        latest = {number: index for index, number in enumerate(rows["row"].to_pylist())}
        return rows.take([latest[number] for number in sorted(latest)]).combine_chunks()

    def _parts(self) -> list[Path]:
        return sorted((self._folder / _PARTS).glob("*.parquet"))

    def _agree_on(self, plan: dict[str, Any]) -> None:
        path = self._folder / _PLAN
        if path.exists():
            before = _plan_before(path)
            different = [key for key in sorted({*before, *plan}) if before.get(key) != plan.get(key)]
            if different:
                what = ", ".join(_with_keys(key, before.get(key), plan.get(key)) for key in different)
                raise ValueError(
                    f"{self._folder} holds rows of another study (its {what} differ): choose another --out, "
                    "or remove the folder"
                )
            return
        if any((self._folder / name).exists() for name in (TABLE, TIMES)) or self._parts():
            raise _of_unknown_study(path, "missing")
        _replace(path, (json.dumps(plan, indent=1, sort_keys=True) + "\n").encode())


def _plan_before(path: Path) -> dict[str, Any]:
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        before = None
    if not isinstance(before, dict):
        raise _of_unknown_study(path, "damaged")
    return before


def _of_unknown_study(plan: Path, fault: str) -> ValueError:
    """The refusal of rows whose plan cannot be read."""
    return ValueError(
        f"{plan} is {fault}, so that nobody knows which study the rows beside it are of: choose another "
        "--out, or remove the folder"
    )


def _with_keys(name: str, before: Any, now: Any) -> str:
    """The name of a part of a plan, with those of its own that are different where it has some."""
    if not (isinstance(before, dict) and isinstance(now, dict)):
        return name
    return f"{name} {' '.join(key for key in sorted({*before, *now}) if before.get(key) != now.get(key))}"


_WALL_TIME = pa.field("wall_s", pa.float64())
_TYPES = {"number": pa.float64(), "text": pa.string(), "count": pa.int64()}


def _read(path: Path, columns: list[str]) -> pa.Table:
    try:
        return pq.read_table(path, columns=columns)
    except (pa.ArrowException, OSError) as error:
        if isinstance(error, OSError) and error.errno:  # of the system; what is packed wrongly has none
            raise
        lost = "wall times alone are lost" if path.name == TIMES else "what it had is run again"
        raise ValueError(f"{path} is damaged: remove it, and {lost}") from error


def _write(table: pa.Table, path: Path) -> None:
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    _replace(path, sink.getvalue())


def _replace(path: Path, content: Any) -> None:
    """Puts a file in its place when it is complete, and on the disk, should the power fail then."""
    unfinished = path.with_suffix(".unfinished")
    with unfinished.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    os.replace(unfinished, path)


def columns_of(factors: Mapping[str, Sequence[Any]], figures: Sequence[str]) -> dict[str, str]:
    """The columns of the table of a study; ``factors``: name -> its values."""
    kinds = {
        name: "text" if any(isinstance(value, str) for value in values) else "number"
        for name, values in factors.items()
    }
    return {
        **dict.fromkeys(("row", "point", "repetition"), "count"),
        "law": "text",
        "seed": "count",
        **kinds,
        **dict.fromkeys(figures, "number"),
        "failure": "text",
        "command": "text",
    }
