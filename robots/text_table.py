"""Tables in text files: lines of fields with their line numbers, for every reader of measurements.

Fields are separated by ``;``, by ``,``, by tabulators or by blanks, the same in the whole file; ``#`` begins
a comment. Where a tabulator stands between any two columns, there may be nothing between two of them. What
the fields mean, their units and their ranges are checked by the reader of each kind of file, whose messages
name file and line through `TextTable.where`.
"""

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


class TextTableError(ValueError):
    """A file cannot be read as a table; the message names the file and, if there is one, the line."""


@dataclass(frozen=True)
class TextTable:
    """The fields of a file, one row a line."""

    name: str  # of the file
    separator: str | None  # None for blanks
    rows: list[list[str]]  # stripped
    lines: list[int]  # of the rows, from one

    def where(self, row: int) -> str:
        """File and line of a row."""
        return f"{self.name}, line {self.lines[row]}"

    def copies(self) -> set[int]:
        """Lines whose fields are all those of an earlier one: a table pasted twice, and no news."""
        first: dict[tuple[str, ...], int] = {}
        return {
            line
            for line, fields in zip(self.lines, self.rows, strict=True)
            if first.setdefault(tuple(fields), line) != line
        }

    def refuse_longer_rows(self) -> None:
        """Raises TextTableError if a row has more fields than the head: which of them belong where?

        Decimal commas in a table with commas between its fields do that. Empty fields at the end, as
        spreadsheets leave them, mean nothing.
        """
        width = len(self.rows[0])
        for row, fields in enumerate(self.rows):
            if any(fields[width:]):
                raise TextTableError(f"{self.where(row)}: {len(fields)} fields, but the head has {width}")


def read_text(path: str | Path) -> str:
    """The text of a file in UTF-8, with or without byte order mark.

    Raises:
        TextTableError: if it is missing, cannot be read or is not text.
    """
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise TextTableError(f"{path}: not a text file in UTF-8") from error
    except OSError as error:
        raise TextTableError(f"{path}: {(error.strerror or str(error)).lower()}") from error


def parse_fields(text: str, name: str, has_head: bool) -> TextTable:
    """Splits a text into fields.

    Args:
        text: the table.
        name: of the file, for messages.
        has_head: whether the first row names the columns. Its separator then is that of the file, fields
            may be quoted, and only whole lines are comments, because a column of remarks may hold a ``#``.

    Raises:
        TextTableError: if there is no row, or quotes cannot be matched.
    """
    numbered = list(enumerate(text.splitlines(), 1))
    if has_head:
        kept = [(number, line) for number, line in numbered if not line.lstrip().startswith("#")]
    else:
        kept = [(number, line.split("#")[0]) for number, line in numbered]
    kept = [(number, line.rstrip()) for number, line in kept if line.strip()]
    if not kept:
        raise TextTableError(f"{name}: the table is empty: there are only comments or blank lines")
    lines = [line.strip() for _, line in kept]
    separator = _separator_of_names(lines[0]) if has_head else _separator(lines)
    if has_head and separator is None and _has_tabs([line for _, line in kept]):
        separator = "\t"
    else:
        kept = [(number, line) for (number, _), line in zip(kept, lines, strict=True)]
    rows = []
    for number, line in kept:
        try:
            fields = (
                next(csv.reader([line], delimiter=separator))
                if has_head and separator
                else line.split(separator)
            )
        except csv.Error as error:
            raise TextTableError(f"{name}, line {number}: {error}") from error
        rows.append([field.strip() for field in fields])
    return TextTable(name, separator, rows, [number for number, _ in kept])


def finite_number(field: str, separator: str | None = None) -> float | None:
    """The number in a field; None if there is none or it is not finite.

    Where ``;`` or tabulators separate the fields, a decimal comma is read, too.
    """
    try:
        value = float(field.replace(",", ".") if separator in (";", "\t") else field)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _has_tabs(lines: Sequence[str]) -> bool:
    """Whether a tabulator stands between any two columns of a head, and the rows below it have some, too."""
    return all("\t" in line for line in lines) and all(name.strip() for name in lines[0].split("\t"))


def _separator_of_names(head: str) -> str | None:
    """What separates the names of a head: blanks may be within one, as in "x [mm],y [mm]"."""
    return "," if "," in head and not re.search("[;\t]", head) else _separator([head])


def _separator(lines: Sequence[str]) -> str | None:
    if any(";" in line for line in lines):
        return ";"
    # "1,5 2,0" are decimal commas between blanks; "1, 5, 2" has a comma in front of every blank.
    if any("," in line for line in lines):
        between_blanks = all(re.search(r"[^,\s]\s+[^,\s]", line) for line in lines)
        return None if between_blanks else ","
    return None
