"""Programs of KUKA controllers: sources and data lists in KRL with ``E6POS`` and ``E6AXIS``.

The tool and the base of a target are those of the ``FDAT`` that belongs to it (``FP1`` to ``XP1``), else what
``$TOOL`` and ``$BASE`` are in the order of the text where it is moved to. Numbers of tools and bases are
looked up in ``TOOL_DATA`` and ``BASE_DATA``, which stand in ``$config.dat``; the load of a tool in
``LOAD_DATA``.
"""

import re
from dataclasses import dataclass, field, replace

import numpy as np

from robots.pose import rotation_from_zyx
from robots.programs.course import Course
from robots.programs.krl_course import is_straight, not_followed, steer
from robots.programs.program import (
    DEGREE,
    JOINTS,
    MILLIMETRE,
    WORLD,
    Frame,
    Literal,
    Note,
    Program,
    ProgramContext,
    ProgramError,
    Source,
    Target,
    homogeneous,
)

_NUMBER = re.compile(r"[+-]?\s*(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_PLACED = re.compile(  # name = {...}, as a declaration or as an assignment
    r"\s*(?:GLOBAL\s+|DECL\s+|CONST\s+)*(?P<type>[A-Z]\w*\s+)?(?P<name>\$?[A-Z_]\w*(?:\[\s*\d*\s*\])?)"
    r"(?P<part>(?:\.\w+)*)\s*=(?!=)\s*(?P<value>.*)",
    re.IGNORECASE,
)
_MOVE = re.compile(r"\s*S?(?:PTP|LIN|CIRC|SPL)(?P<relative>_REL)?\b(?!\s*=)", re.IGNORECASE)
_NAME = re.compile(r"\s*(\$?[A-Z_]\w*(?:\[[^\]]*\])?)", re.IGNORECASE)
_SUGGESTED = re.compile(r"\s*BAS\s*\(\s*#(TOOL|BASE)\s*,\s*(-?\d+)\s*\)", re.IGNORECASE)
_KEY = re.compile(r"\s*([A-Z]\w*)(?:\[\])?\s+", re.IGNORECASE)
_CARTESIAN = {"X": "x", "Y": "y", "Z": "z", "A": "alpha", "B": "beta", "C": "gamma"}
_TURNS = {"S": "status", "T": "turn"}
_AXES = {f"A{number}": role for number, role in enumerate(JOINTS, 1)}
_UNITS = {**dict.fromkeys("xyz", MILLIMETRE), **dict.fromkeys(("alpha", "beta", "gamma", *JOINTS), DEGREE)}
_NULL = {0, -1}  # numbers of the flange as tool and of the world as base


@dataclass(frozen=True)
class _Line:
    """The code of one line, without its comment."""

    source: Source
    number: int
    start: int  # of its first character in the text
    code: str

    @property
    def where(self) -> str:
        """File and line, for messages."""
        return self.source.where(self.number)


@dataclass(frozen=True)
class _Value:
    """An aggregate ``{X 1, Y 2}``: its literals, and the text of everything else, by the capital key."""

    line: _Line
    numbers: dict[str, Literal]
    texts: dict[str, str]

    def number(self, key: str) -> int:
        """An integer in it. Raises ProgramError if it is not there."""
        if key not in self.numbers:
            raise ProgramError(f"{self.line.where}: {key} must be a number")
        return int(self.numbers[key].value)


@dataclass(frozen=True)
class _State:
    """Tool and base where the text has arrived; None where nothing has said them."""

    tool: Frame | None = None
    base: Frame | None = None
    load: float | None = None  # kg


@dataclass
class _Place:
    """A target on its way to become one."""

    name: str
    line: _Line
    numbers: dict[str, Literal]
    uses: list[tuple[_Line, _State]] = field(default_factory=list)


def read_krl(source: Source, context: ProgramContext) -> Program:
    """Reads a source or a data list.

    Raises:
        ProgramError: if a tool or a base is not declared or cannot be read, or if one target is moved to with
            several of them.
    """
    return _Reader(source, context).program()


class _Reader:
    """One file with what others declare."""

    def __init__(self, source: Source, context: ProgramContext) -> None:
        self._source, self._context = source, context
        self._notes: list[Note] = []
        self._values: dict[str, _Value] = {}  # TOOL_DATA[1], FP1, ... by capital name
        self._places: dict[str, list[_Place]] = {}
        self._inline: list[_Place] = []
        self._state = _State()
        self._course = Course()

    def program(self) -> Program:
        """The targets with their frames."""
        files = [_lines(each) for each in (self._source, *self._context.others)]
        for lines in reversed(files):
            for line in lines:
                self._declare(line)
        for lines in files:
            self._state = _State()
            for line in lines:
                if line.source is self._source:
                    steer(self._course, line.number, line.code)
                self._follow(line)
        known = [place for group in self._places.values() for place in group] + self._inline
        places = [place for place in known if place.line.source is self._source]
        places.sort(key=lambda place: min(each.start for each in place.numbers.values()))
        targets = [target for target in map(self._target, places) if target is not None]
        notes = sorted(set(self._notes), key=lambda note: note.line)
        return Program(
            self._source.name, self._source.text, tuple(targets), tuple(notes), self._course.moves()
        )

    def _note(self, line: _Line, text: str) -> None:
        if line.source is self._source:
            self._notes.append(Note(line.number, text))

    def _declare(self, line: _Line) -> None:
        match = _PLACED.match(line.code)
        if not match or match["part"] or not match["value"].startswith("{"):
            return
        name = re.sub(r"\s", "", match["name"]).upper()
        value = _aggregate(line, match.start("value"))
        self._values[name] = value
        if name.startswith("$") or "_DATA[" in name:
            return
        kind = (match["type"] or "").strip().upper()
        roles = _roles(value)
        if roles:
            self._places.setdefault(name, []).append(_Place(match["name"], line, roles))
        elif kind in ("E6POS", "POS", "E6AXIS", "AXIS"):
            self._note(line, f"{match['name']} is not given in numbers alone, left alone")

    def _follow(self, line: _Line) -> None:
        """Takes from a line where it moves, and with what."""
        suggested = _SUGGESTED.match(line.code)
        if suggested:
            kind, number = suggested[1].upper(), int(suggested[2])
            self._state = replace(self._state, **{kind.lower(): self._numbered(kind, number, line)})
            if kind == "TOOL":
                self._state = replace(self._state, load=self._load(number))
        match = _PLACED.match(line.code)
        if match:
            name = match["name"].upper() + match["part"]
            self._assign(line, name, match["value"].strip(), match.start("value"))
            return
        match = _MOVE.match(line.code)
        if match and match["relative"]:
            self._note(line, "moves by a distance from where the robot is, left alone")
            self._go(line, None, "moves by a distance from where the robot is, which is not followed")
        elif match:
            self._move(line, match.end())

    def _assign(self, line: _Line, name: str, value: str, at: int) -> None:
        if name in ("$TOOL", "$BASE"):
            frame = self._frame_value(line, name, value, at)
            self._state = replace(self._state, **{name[1:].lower(): frame})
            number = re.fullmatch(r"TOOL_DATA\[\s*(\d+)\s*\]", value, re.IGNORECASE)
            if number:
                self._state = replace(self._state, load=self._load(int(number[1])))
        elif name == "$LOAD":
            found = _aggregate(line, at) if value.startswith("{") else self._values.get(value.upper())
            mass = found.numbers.get("M") if found else None
            if mass is None:
                raise ProgramError(f"{line.where}: the mass of {value} is not known; --with FILE reads it")
            self._state = replace(self._state, load=mass.value)
        elif name == "FDAT_ACT" and value.upper() in self._values:
            self._state = self._of_fdat(self._values[value.upper()]) or self._state
        elif not value.startswith("{"):
            base = re.split(r"[.\[]", name)[0]
            self._course.assign(base)
            for place in self._places.pop(base, []):
                self._note(place.line, f"{place.name} is given another value by the program, left alone")

    def _frame_value(self, line: _Line, name: str, value: str, at: int) -> Frame:
        if value.upper() in ("$NULLFRAME", "$WORLD"):
            return Frame("$NULLFRAME", np.eye(4))
        if value.startswith("{"):
            return Frame(name, _pose(_aggregate(line, at), name))
        number = re.fullmatch(r"(TOOL|BASE)_DATA\[\s*(-?\d+)\s*\]", value, re.IGNORECASE)
        if number:
            return self._numbered(number[1].upper(), int(number[2]), line)
        if value.upper() in self._values:
            return Frame(value, _pose(self._values[value.upper()], value))
        raise ProgramError(f"{line.where}: {name} = {value} cannot be read; --with FILE reads further files")

    def _numbered(self, kind: str, number: int, line: _Line) -> Frame:
        """TOOL_DATA[n] or BASE_DATA[n]."""
        name = f"{kind}_DATA[{number}]"
        if number in _NULL:
            return Frame(name, np.eye(4))
        if name not in self._values:
            raise ProgramError(f"{line.where}: {name} is not declared; --with $config.dat reads it")
        return Frame(name, _pose(self._values[name], name))

    def _load(self, number: int) -> float | None:
        """What the controller knows to hang at the flange with a tool, kg."""
        value = self._values.get(f"LOAD_DATA[{number}]")
        mass = value.numbers.get("M") if value else None
        return mass.value if mass and mass.value >= 0.0 else None

    def _of_fdat(self, value: _Value) -> _State | None:
        """Tool and base of a target; None if the tool stands still."""
        if value.texts.get("IPO_FRAME", "").upper() == "#TCP":
            return None
        tool, base = value.number("TOOL_NO"), value.number("BASE_NO")
        frames = self._numbered("TOOL", tool, value.line), self._numbered("BASE", base, value.line)
        return _State(*frames, self._load(tool))

    def _move(self, line: _Line, at: int) -> None:
        """The places that a motion names or holds; two of them in a circle."""
        is_circle, arrival, why = "CIRC" in line.code[:at].upper(), None, ""
        spans = _parts(line.code, at, len(line.code))
        for start, end in spans[: 2 if is_circle else 1]:
            at = start + len(line.code[start:end]) - len(line.code[start:end].lstrip())
            places, name = [], _NAME.match(line.code, at, end)
            if line.code[at:end].startswith("{"):
                roles, at = _roles(_aggregate(line, at)), _closing(line, at)
                if not roles:
                    self._note(line, "gives parts of a pose, or expressions, left alone")
                elif line.source is self._source:
                    self._inline.append(_Place("", line, roles))
                    arrival, places = self._inline[-1], self._inline[-1:]
            elif name:
                at = name.end()
                whole = name[1].upper()
                places = self._places.get(whole) or self._places.get(whole.split("[")[0], [])
                arrival = places[0] if len(places) == 1 and whole in self._places else None
            if line.code[at:end].lstrip().startswith(":"):
                self._note(line, "moves beside the target, by a sum of frames: shifted with it, no more")
                why = "moves beside the target, by a sum of frames, which is not followed"
            for place in places:
                place.uses.append((line, self._state))
        start, end = spans[0]
        text = re.sub(r"\s+C_\w+\s*$", "", line.code[start:end])
        self._go(line, arrival, why, text)

    def _go(self, line: _Line, place: _Place | None, why: str, text: str = "") -> None:
        """Takes a motion into the course of the file; ``text`` is where to, ``why`` it is not followed."""
        if line.source is not self._source:
            return
        fdat = self._fdat(place) if place else None
        state = self._of_fdat(fdat) if fdat else self._state
        why = why or ("" if state else "belongs to a tool that stands still, which is not followed")
        state = state or self._state
        has_tool = place is not None and ("q1" in place.numbers or state.tool is not None)
        why = why or not_followed(line.code, text, place is not None, has_tool)
        numbers = place.numbers if place else {}
        target = Target(place.name if place else "", line.number, numbers, state.tool, state.base or WORLD)
        self._course.move(line.number, target if place else None, is_straight(line.code), why)

    def _fdat(self, place: _Place) -> _Value | None:
        """The frame data that belong to a taught target."""
        name = place.name.upper()
        value = self._values.get(f"F{name[1:]}") if name.startswith("X") else None
        return value if value and "TOOL_NO" in value.numbers else None

    def _target(self, place: _Place) -> Target | None:
        """The target with its frames; None where nothing says its tool."""
        fdat = self._fdat(place)
        if fdat:
            state = self._of_fdat(fdat)
            if state is None:
                self._note(place.line, f"{place.name} belongs to a tool that stands still, left alone")
                return None
            uses = [(fdat.line, state)]
        else:
            uses = [(line, state) for line, state in place.uses if state.tool is not None]
        if not uses and self._context.tool:
            uses = [(place.line, self._by_default(place.line))]
        if not uses:
            name = place.name or "the target"
            self._note(place.line, f"nothing says the tool of {name}; --tool N says it, left alone")
            return None
        first_line, first = uses[0]
        for line, state in uses[1:]:
            for kind, a, b in (("tool", state.tool, first.tool), ("base", state.base, first.base)):
                if not np.allclose((a or WORLD).X, (b or WORLD).X, rtol=0.0, atol=1e-12):
                    raise ProgramError(
                        f"{line.where}: {place.name} is moved to with another {kind} than in "
                        f"{first_line.where}: no single place is right for both"
                    )
        payloads = tuple(sorted({state.load for _, state in uses if state.load is not None}))
        base = first.base or WORLD
        return Target(place.name, place.line.number, place.numbers, first.tool, base, payloads)

    def _by_default(self, line: _Line) -> _State:
        for option, text in (("--tool", self._context.tool), ("--base", self._context.base or "0")):
            if not re.fullmatch(r"-?\d+", text):
                raise ProgramError(f"{option} must be a number in KRL, got '{text}'")
        tool = int(self._context.tool)
        base = self._numbered("BASE", int(self._context.base or "0"), line)
        return _State(self._numbered("TOOL", tool, line), base, self._load(tool))


def _lines(source: Source) -> list[_Line]:
    """The code of every line."""
    found, start = [], 0
    for number, text in enumerate(re.split(r"(?<=\n)|(?<=\r)(?!\n)", source.text), 1):
        # What stands between quotes is no code: blanks in its place keep all characters where they are.
        quiet = re.sub(r'"[^"\r\n]*"', lambda match: f'"{" " * (len(match[0]) - 2)}"', text)
        code = re.split(r"[;\r\n]", quiet, maxsplit=1)[0]
        if code.strip() and not code.startswith("&"):
            found.append(_Line(source, number, start, code))
        start += len(text)
    return found


def _closing(line: _Line, at: int) -> int:
    """Behind the brace that closes the one at a character."""
    depth = 0
    for end in range(at, len(line.code)):
        depth += (line.code[end] == "{") - (line.code[end] == "}")
        if depth == 0:
            return end + 1
    raise ProgramError(f"{line.where}: a brace is not closed")


def _aggregate(line: _Line, at: int) -> _Value:
    """The aggregate that begins with the brace at a character."""
    end = _closing(line, at) - 1
    inside = at + 1
    kind = re.match(r"\s*[A-Z]\w*\s*:", line.code[inside:end], re.IGNORECASE)
    inside += kind.end() if kind else 0
    value = _Value(line, {}, {})
    for start, stop in _parts(line.code, inside, end):
        _take(value, start, line.code[start:stop])
    return value


def _parts(code: str, start: int, end: int) -> list[tuple[int, int]]:
    """Where the parts of a list stand that commas separate, outside of all brackets."""
    parts, depth = [], 0
    for at in range(start, end):
        depth += (code[at] in "{[(") - (code[at] in "}])")
        if code[at] == "," and not depth:
            parts.append((start, at))
            start = at + 1
    return [*parts, (start, end)]


def _take(value: _Value, at: int, part: str) -> None:
    """One ``key value`` of an aggregate, which begins at a character of the line."""
    key = _KEY.match(part)
    if not key:
        return
    text = part[key.end() :].strip()
    start = at + key.end() + (len(part[key.end() :]) - len(part[key.end() :].lstrip()))
    if _NUMBER.fullmatch(text):
        first = value.line.start + start
        number = float(re.sub(r"\s", "", text))
        value.numbers[key[1].upper()] = Literal(first, first + len(text), number)
    else:
        value.texts[key[1].upper()] = text


def _roles(value: _Value) -> dict[str, Literal]:
    """The literals of a whole pose or of all six axes by their roles; empty for anything else."""
    for keys in (_CARTESIAN, _AXES):
        if all(key in value.numbers for key in keys):
            extra = _TURNS if keys is _CARTESIAN else {}
            roles = {role: value.numbers[key] for key, role in (keys | extra).items() if key in value.numbers}
            return {role: replace(each, unit=_UNITS.get(role, 1.0)) for role, each in roles.items()}
    return {}


def _pose(value: _Value, name: str) -> np.ndarray:
    roles = _roles(value)
    if "x" not in roles:
        raise ProgramError(f"{value.line.where}: {name} must be given in numbers")
    zyx = np.array([roles[role].si for role in ("alpha", "beta", "gamma")])
    return homogeneous([roles[role].si for role in "xyz"], rotation_from_zyx(zyx))
