"""Tables of poses or joint positions as programs: only the fields of numbers are ever replaced.

The first line that is not a comment names the columns: ``x_mm``, ``y_mm``, ``z_mm`` (or ``_m``) with ``qw``,
``qx``, ``qy``, ``qz`` or the ZYX Euler angles ``alpha_deg``, ``beta_deg``, ``gamma_deg`` (or ``_rad``), of
the tool of the robot file in the world; or ``q1_deg`` ... ``q6_deg`` (or ``_rad``). ``payload_kg`` and
``name`` if there are such. Fields are separated by ``;`` (then decimal commas are read too), by ``,`` or by
tabulators.
"""

import re
from collections.abc import Mapping

from robots.programs.program import (
    DEGREE,
    JOINTS,
    MILLIMETRE,
    POSITION,
    Literal,
    Move,
    Note,
    Program,
    ProgramContext,
    ProgramError,
    Source,
    Target,
    quaternion_problem,
)

_UNITS = {"mm": MILLIMETRE, "m": 1.0, "deg": DEGREE, "rad": 1.0}
_QUATERNION, _EULER = ("qw", "qx", "qy", "qz"), ("alpha", "beta", "gamma")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_LEFT = ", row left alone"
_COMMA = re.compile(r"[+-]?(\d+,\d*|,\d+)([eE][+-]?\d+)?")


def read_pose_table(source: Source, context: ProgramContext) -> Program:
    """Reads a table.

    Raises:
        ProgramError: if columns are missing, twice there (in two units, too), or of both kinds, or if no row
            is one of numbers.
    """
    if context.others or context.tool or context.base:
        raise ProgramError(f"{source.name}: a table knows the tool of the robot file only, and the world")
    header: dict[str, int] = {}
    separator, targets, notes, moves = ",", [], [], []
    for match in re.finditer(r"[^\r\n]+", source.text):
        line, text = source.line(match.start()), match.group()
        if not text.strip() or text.lstrip("\ufeff\xef\xbb\xbf ").startswith("#"):
            continue
        if not header:
            separator = next((each for each in ";,\t" if each in text), ",")
            header = _header(source, line, text.lstrip("\xef\xbb\xbf"), separator)
            continue
        fields = _fields(text, match.start(), separator)
        target = _row(line, fields, header, separator)
        if isinstance(target, Note):
            notes.append(target)
            moves.append(Move(line, None, why_not=target.text.removesuffix(_LEFT)))
        else:
            targets.append(target)
            moves.append(Move(line, target, not target.has_joints))
    if not targets:
        raise ProgramError(f"{source.name}: no row of numbers; {notes[0].text if notes else 'it is empty'}")
    return Program(source.name, source.text, tuple(targets), tuple(notes), tuple(moves))


def _header(source: Source, line: int, text: str, separator: str) -> dict[str, int]:
    """Places of the columns by their names."""
    names = [field.strip().strip('"').strip() for field in text.split(separator)]
    where = source.where(line)
    twice = {name for name in names if name and names.count(name) > 1}
    if twice:
        raise ProgramError(f"{where}: column {min(twice)} is there twice")
    columns = {name: number for number, name in enumerate(names)}
    of_pose, joints = (
        [name for role in roles for name in _names(role) if name in columns]
        for roles in (POSITION + _QUATERNION + _EULER, JOINTS)
    )
    if of_pose and joints:
        raise ProgramError(
            f"{where}: the table has poses and joint positions; which of them is to be corrected?"
        )
    surplus = _second(columns)
    if surplus:
        raise ProgramError(f"{where}: {surplus} say the same; which of them is to be corrected?")
    roles = _needed(columns)
    missing = [role for role in roles if _column(columns, role) is None]
    if missing:
        wanted = " or ".join(_names(missing[0]))
        raise ProgramError(f"{where}: column {wanted} is missing; there are {', '.join(names)}")
    return columns


def _needed(columns: Mapping[str, int]) -> tuple[str, ...]:
    if _column(columns, JOINTS[0]) or JOINTS[0] in columns:  # one without its unit is asked for it
        return JOINTS
    return POSITION + (_QUATERNION if "qw" in columns else _EULER)


def _second(columns: Mapping[str, int]) -> str:
    """Two columns of which only one would be corrected: of two units, or both kinds of orientation."""
    for role in POSITION + _EULER + JOINTS:
        there = [name for name in _names(role) if name in columns]
        if len(there) > 1:
            return " and ".join(there)
    euler = [name for role in _EULER for name in _names(role) if name in columns]
    quaternion = [name for name in _QUATERNION if name in columns]
    return f"{quaternion[0]} and {euler[0]}" if quaternion and euler else ""


def _names(role: str) -> dict[str, float]:
    """Names that a column may have, with the unit of each."""
    if role in _QUATERNION:
        return {role: 1.0}
    units = ("mm", "m") if role in POSITION else ("deg", "rad")
    return {f"{role}_{unit}": _UNITS[unit] for unit in units}


def _column(columns: Mapping[str, int], role: str) -> tuple[int, float] | None:
    """Place and unit of a column; None if there is none."""
    return next(((columns[name], unit) for name, unit in _names(role).items() if name in columns), None)


def _row(
    line: int, fields: list[tuple[int, str]], columns: Mapping[str, int], separator: str
) -> Target | Note:
    numbers = {}
    for role in _needed(columns):
        column = _column(columns, role)
        assert column is not None
        place, unit = column
        literal = _literal(*fields[place], unit, separator) if place < len(fields) else None
        if literal is None:
            text = fields[place][1].strip().strip('"').strip() if place < len(fields) else ""
            name = next(name for name in _names(role) if name in columns)
            problem = f"{name} is not a number: '{text}'" if text else f"the number of {name} is missing"
            return Note(line, f"{problem}{_LEFT}")
        numbers[role] = literal
    problem = quaternion_problem(numbers) or _surplus(fields, columns)
    if problem:
        return Note(line, f"{problem}{_LEFT}")
    payloads: tuple[float, ...] = ()
    if "payload_kg" in columns:
        place = columns["payload_kg"]
        payload = _literal(*fields[place], 1.0, separator) if place < len(fields) else None
        if payload is None:
            return Note(line, f"payload_kg is not a number{_LEFT}")
        if payload.value < 0.0:
            return Note(line, f"payload_kg must not be negative, got {payload.value:g}{_LEFT}")
        payloads = (payload.value,)
    place = columns.get("name", len(fields))
    name = fields[place][1].strip().strip('"') if place < len(fields) else ""
    return Target(name, line, numbers, payloads=payloads)


def _surplus(fields: list[tuple[int, str]], columns: Mapping[str, int]) -> str:
    """What a row has beyond the columns: it may be that a decimal comma has shifted all of it."""
    count = max(columns.values()) + 1
    if not any(text.strip() for _, text in fields[count:]):
        return ""
    return f"there are {len(fields)} values for {count} columns"


def _literal(start: int, text: str, unit: float, separator: str) -> Literal | None:
    """The number in a field that begins at a character; None if there is none."""
    inner = text.strip().strip('"').strip()
    start += text.index(inner)
    if _NUMBER.fullmatch(inner):
        return Literal(start, start + len(inner), float(inner), unit)
    if separator != "," and _COMMA.fullmatch(inner):
        value = float(inner.replace(",", "."))
        return Literal(start, start + len(inner), value, unit, has_comma=True)
    return None


def _fields(text: str, start: int, separator: str) -> list[tuple[int, str]]:
    """Fields of a line with the character at which each begins; quotes hold separators."""
    # Blanks beside quotes, but no tab: that may be the separator.
    pattern = re.compile(rf' *"(?:[^"]|"")*" *|[^{re.escape(separator)}]*')
    fields, at = [], 0
    while True:
        match = pattern.match(text, at)
        assert match is not None
        fields.append((start + at, match.group()))
        at = match.end()
        if at >= len(text):
            return fields
        at += len(separator)
