"""Reading text files of numbers; errors are reported with file and line.

A line holds one measurement; its numbers are separated by ``;``, by ``,`` or by blanks, the same in the whole
file. ``#`` begins a comment; a head line is refused, or kept where the caller wants one. Decimal commas are
read where ``;`` or blanks separate; where commas do, "1,5" could be one number or two, and a file that could
be read both ways is refused.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robots.text_table import TextTableError, parse_fields, read_text

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_FRACTION = re.compile(r"\d+([eE][+-]?\d+)?")
_DECIMAL_COMMA = re.compile(r"[+-]?(\d+,\d*|,\d+)([eE][+-]?\d+)?")
_WORD = re.compile(r"[\"(\[]*[^\W\d_]")  # a unit may stand apart, in brackets


class NumberFileError(ValueError):
    """A file cannot be read as measurements; the message names the line."""


@dataclass(frozen=True)
class NumberTable:
    """The numbers of a file, one row a measurement."""

    name: str  # of the file
    values: np.ndarray  # (n, columns), as written
    lines: tuple[int, ...]  # of the rows, from one
    head: tuple[str, ...] = ()  # names of the columns, where a head line has some
    head_line: int = 0

    @property
    def columns(self) -> int:
        """How many numbers a row has."""
        return self.values.shape[1]

    def where(self, rows: Sequence[int] | np.ndarray = ()) -> str:
        """File and lines of some rows, of all if none is given."""
        lines = sorted(self.lines[row] for row in rows) or [self.lines[0], self.lines[-1]]
        if len(set(lines)) == 1:
            return f"{self.name}, line {lines[0]}"
        return f"{self.name}, lines {lines[0]} to {lines[-1]}"

    def error(self, message: str, rows: Sequence[int] | np.ndarray = ()) -> NumberFileError:
        """The refusal of some rows, or of all."""
        return NumberFileError(f"{self.where(rows)}: {message}")


def read_table(path: str | Path, may_have_head: bool = False) -> NumberTable:
    """Reads the numbers of a file.

    Args:
        path: of the file.
        may_have_head: whether its first line may name the columns.

    Raises:
        NumberFileError: if the file is missing, empty, not text, not rectangular, or holds anything that
            is not a finite number.
    """
    try:
        text = read_text(path)
    except TextTableError as error:
        raise NumberFileError(str(error)) from error
    return parse_table(text, str(path), may_have_head)


def parse_table(text: str, name: str, may_have_head: bool = False) -> NumberTable:
    """The numbers of a text; ``name`` is where it came from, ``may_have_head`` as for `read_table`.

    Raises:
        NumberFileError: see `read_table`.
    """
    try:
        table = parse_fields(text, name, has_head=False)
        has_head = len(table.rows) > 1 and all(map(_is_name, table.rows[0]))
        if has_head and not may_have_head:
            raise NumberFileError(
                f"{table.where(0)}: a head line ('{table.rows[0][0]}') has no meaning here: only numbers, "
                "# in front of it makes it a comment"
            )
        if has_head:
            table = parse_fields(text, name, has_head=True)
    except TextTableError as error:
        raise NumberFileError(str(error)) from error
    fields, separator = dict(zip(table.lines, table.rows, strict=True)), table.separator
    _refuse_ragged_rows(name, fields)
    head_line = table.lines[0] if has_head else 0
    head = tuple(fields.pop(head_line, ()))
    if separator == "," and not head:  # whose names say how many numbers there are
        _refuse_hidden_decimal_commas(name, fields)
    _refuse_two_decimal_marks(name, fields)
    values = [[_number(name, line, field) for field in row] for line, row in fields.items()]
    return NumberTable(name, np.array(values), tuple(fields), head, head_line)


def _refuse_ragged_rows(name: str, fields: dict[int, list[str]]) -> None:
    (first, row), *others = fields.items()
    for line, other in others:
        if len(other) != len(row):
            raise NumberFileError(
                f"{name}, line {line}: {len(other)} numbers, but {len(row)} in line {first} "
                "(decimal commas? then separate by ;)"
            )


def _refuse_hidden_decimal_commas(name: str, fields: dict[int, list[str]]) -> None:
    """Without a point in the file, "1,5,2,0" may be four numbers or two."""
    rows = list(fields.values())
    if any("." in field for row in rows for field in row) or len(rows[0]) % 2:
        return
    if all(_FRACTION.fullmatch(field) for row in rows for field in row[1::2]):
        raise NumberFileError(
            f"{name}, line {next(iter(fields))}: may be decimal commas: every second number is a row of "
            "digits and none has a point; separate by ; or write 1.0 for 1"
        )


def _refuse_two_decimal_marks(name: str, fields: dict[int, list[str]]) -> None:
    marked = {mark: line for line, row in fields.items() for mark in ".," if any(mark in f for f in row)}
    if len(marked) == 2:
        raise NumberFileError(
            f"{name}, line {max(marked.values())}: decimal points and decimal commas in one file"
        )


def _is_name(field: str) -> bool:
    """Whether a field is a word rather than a number or a slip in one."""
    return bool(_WORD.match(field)) and field.lower() not in ("nan", "inf", "infinity")


def _number(name: str, line: int, field: str) -> float:
    value = math.nan
    if _NUMBER.fullmatch(field):
        value = float(field)
    elif _DECIMAL_COMMA.fullmatch(field):
        value = float(field.replace(",", "."))
    if not math.isfinite(value):
        raise NumberFileError(
            f"{name}, line {line}: '{field}' is not a finite number (separators are ; or , or blanks)"
        )
    return value
