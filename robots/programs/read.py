"""Reads a program in whichever language its name says."""

from collections.abc import Sequence
from pathlib import Path

from robots.programs.krl import read_krl
from robots.programs.pose_table import read_pose_table
from robots.programs.program import Program, ProgramContext, ProgramError, Source, read_source
from robots.programs.rapid import read_rapid

_RAPID, _KRL, _TABLE = (".mod", ".prg", ".sys", ".modx", ".sysx"), (".src", ".dat"), (".csv", ".txt")
_READERS = {
    **dict.fromkeys(_RAPID, read_rapid),
    **dict.fromkeys(_KRL, read_krl),
    **dict.fromkeys(_TABLE, read_pose_table),
}
SUFFIXES = tuple(_READERS)


def read_program(path: str | Path, others: Sequence[str] = (), tool: str = "", base: str = "") -> Program:
    """Reads a program.

    Args:
        path: of a RAPID module, a KRL source or data list, or a table.
        others: files that declare tools and frames, or move to the targets of this one.
        tool: declared name, or number in KRL, for targets of which nothing says the tool.
        base: likewise of the work object or base.

    Raises:
        ProgramError: if a file cannot be read; the message names file and line.
    """
    context = ProgramContext(tuple(read_source(other) for other in others), tool, base)
    return parse_program(read_source(path), context)


def parse_program(source: Source, context: ProgramContext | None = None) -> Program:
    """Reads a program from its text. Raises ProgramError."""
    suffix = Path(source.name).suffix.lower()
    if suffix not in _READERS:
        raise ProgramError(f"{source.name}: the name of a program must end in one of {', '.join(_READERS)}")
    return _READERS[suffix](source, context or ProgramContext())
