"""Columns of a recorded table by their names: text with a head, or Parquet."""

from pathlib import Path
from typing import Protocol

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from robots.identification.recording import RecordingError
from robots.text_table import finite_number, parse_fields, read_text

PARQUET = ".parquet"


class Columns(Protocol):
    """A table."""

    def where(self, row: int) -> str:
        """File and place of a row, for messages."""
        ...

    def texts(self, name: str) -> list[str]:
        """A column as it is written."""
        ...

    def numbers(self, names: list[str]) -> np.ndarray:
        """Columns as finite numbers, (rows, columns)."""
        ...


def read_columns(path: Path) -> Columns:
    """Opens a table.

    Raises:
        TextTableError: if a text cannot be read as a table.
        RecordingError: if a Parquet file cannot be read, or rows of a text are not as long as its head.
    """
    return _ArrowColumns(path) if path.suffix.lower() == PARQUET else _TextColumns(path)


class _TextColumns:
    def __init__(self, path: Path) -> None:
        self._table = parse_fields(read_text(path), str(path), has_head=True)
        self._head = self._table.rows[0]
        for row, fields in enumerate(self._table.rows):
            if len(fields) != len(self._head):
                raise RecordingError(
                    f"{self._table.where(row)}: {len(fields)} fields, but the head has {len(self._head)}"
                )

    def where(self, row: int) -> str:
        return self._table.where(row + 1)

    def texts(self, name: str) -> list[str]:
        place = self._place(name)
        return [fields[place] for fields in self._table.rows[1:]]

    def numbers(self, names: list[str]) -> np.ndarray:
        places = [self._place(name) for name in names]
        found = np.empty((len(self._table.rows) - 1, len(names)))
        for row, fields in enumerate(self._table.rows[1:]):
            for column, place in enumerate(places):
                value = finite_number(fields[place], self._table.separator)
                if value is None:
                    raise RecordingError(
                        f"{self.where(row)}: '{fields[place]}' in column '{names[column]}' is no number"
                    )
                found[row, column] = value
        return found

    def _place(self, name: str) -> int:
        _require(self._table.name, name, self._head)
        return self._head.index(name)


class _ArrowColumns:
    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._table = pq.read_table(path)
        except (OSError, pa.ArrowException) as error:
            raise RecordingError(f"{path}: {' '.join(str(error).split())}") from error

    def where(self, row: int) -> str:
        return f"{self._path}, row {row + 1}"

    def texts(self, name: str) -> list[str]:
        return [str(value) for value in self._column(name).to_pylist()]

    def numbers(self, names: list[str]) -> np.ndarray:
        found = np.empty((self._table.num_rows, len(names)))
        for column, name in enumerate(names):
            for row, value in enumerate(self._column(name).to_pylist()):
                if not isinstance(value, int | float) or not np.isfinite(value):
                    raise RecordingError(f"{self.where(row)}: '{value}' in column '{name}' is no number")
                found[row, column] = value
        return found

    def _column(self, name: str) -> pa.ChunkedArray:
        _require(str(self._path), name, self._table.column_names)
        return self._table.column(name)


def _require(table: str, name: str, head: list[str]) -> None:
    if name not in head:
        raise RecordingError(f"{table}: no column '{name}', there are {', '.join(head)}")
