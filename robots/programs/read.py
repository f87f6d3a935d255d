"""Reads a program in whichever language its name says."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from robots.description.placement import LONGEST_TOOL
from robots.programs.krl import read_krl
from robots.programs.pose_table import read_pose_table
from robots.programs.program import (
    DEGREE,
    JOINTS,
    MILLIMETRE,
    POSITION,
    Literal,
    Note,
    Program,
    ProgramContext,
    ProgramError,
    Source,
    read_source,
)
from robots.programs.rapid import read_rapid

_RAPID, _KRL, _TABLE = (".mod", ".prg", ".sys", ".modx", ".sysx"), (".src", ".dat"), (".csv", ".txt")
_READERS = {
    **dict.fromkeys(_RAPID, read_rapid),
    **dict.fromkeys(_KRL, read_krl),
    **dict.fromkeys(_TABLE, read_pose_table),
}
SUFFIXES = tuple(_READERS)
_ROWS = 2  # of a table of joints, from which on its values say something of their unit
_TURN = 2.0 * np.pi  # rad
_FARTHEST = 5.0  # m, that a robot reaches; in mm nothing so near to its base axis
_SHORTEST_TOOL = 2e-3  # m; one of up to 2 m whose numbers are in m and not in mm is shorter


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
    program = _READERS[suffix](source, context or ProgramContext())
    return replace(program, notes=(*program.notes, *_doubtful_tools(source, program)))


def unit_in_doubt(path: str | Path) -> str:
    """Why a table seems to be in another unit than it says; empty if it does not, or is no table.

    Radians below heads of degrees are all within a turn of 6.28, metres below heads of millimetres within the
    reach of any robot in m, and hardly any is a whole number.

    Raises:
        ProgramError: as of `read_program`.
    """
    if Path(path).suffix.lower() not in _TABLE:
        return ""
    program = read_program(path)
    joints = [[each.numbers[role] for role in JOINTS] for each in program.targets if each.has_joints]
    places = [[each.numbers[role] for role in POSITION] for each in program.targets if not each.has_joints]
    if len(joints) >= _ROWS and _are_small(joints, DEGREE, _TURN):
        return (
            f"{program.name}: all joints are within {_TURN:.2f} degrees of zero; if they are in rad, its "
            "columns are q1_rad to q6_rad"
        )
    if _are_small(places, MILLIMETRE, _FARTHEST):
        return (
            f"{program.name}: all numbers of x_mm, y_mm and z_mm are within {_FARTHEST:g} mm of zero; if "
            "they are in m, its columns are x_m, y_m and z_m"
        )
    return ""


def _are_small(rows: Sequence[Sequence[Literal]], unit: float, most: float) -> bool:
    """Whether all numbers are in a unit, none is beyond a value, and most but zeros are broken."""
    values = np.array([each.value for row in rows for each in row])
    if np.abs(values).max(initial=0.0) > most or any(each.unit != unit for row in rows for each in row):
        return False
    return bool(2 * np.count_nonzero(values != np.round(values)) > np.count_nonzero(values))


def _doubtful_tools(source: Source, program: Program) -> list[Note]:
    """Tools that are too short to be in mm. Raises ProgramError for one that is too long."""
    short = {}
    for target in program.targets:
        if target.tool is None:
            continue
        length = float(np.linalg.norm(target.tool.X[:3, 3]))
        if length > LONGEST_TOOL:
            raise ProgramError(
                f"{source.where(target.line)}: the tool {target.tool.name} is {length:g} m long, more than "
                f"{LONGEST_TOOL:g} m; is it in mm?"
            )
        if 0.0 < length < _SHORTEST_TOOL:
            text = f"the tool {target.tool.name} is only {1e3 * length:.3g} mm long; is it in mm?"
            short.setdefault(target.tool.name, Note(target.line, text))
    return list(short.values())
