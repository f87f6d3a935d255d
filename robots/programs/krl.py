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
from robots.programs.krl_text import Line, Value, aggregate, closing, code_lines, parts
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

_PLACED = re.compile(  # name = {...}, as a declaration or as an assignment
    r"\s*(?:GLOBAL\s+|DECL\s+|CONST\s+)*(?P<type>[A-Z]\w*\s+)?(?P<name>\$?[A-Z_]\w*(?:\[[^\]]*\])?)"
    r"(?P<part>(?:\.\w+)*)\s*=(?!=)\s*(?P<value>.*)",
    re.IGNORECASE,
)
_MOVE = re.compile(r"\s*S?(?:PTP|LIN|CIRC|SPL)(?P<relative>_REL)?\b(?!\s*=)", re.IGNORECASE)
_NAME = re.compile(r"\s*(\$?[A-Z_]\w*(?:\[[^\]]*\])?)", re.IGNORECASE)
_SUGGESTED = re.compile(r"\s*BAS\s*\(\s*#(TOOL|BASE)\s*,\s*(-?\d+)\s*\)", re.IGNORECASE)
_CARTESIAN = {"X": "x", "Y": "y", "Z": "z", "A": "alpha", "B": "beta", "C": "gamma"}
_TURNS = {"S": "status", "T": "turn"}
_AXES = {f"A{number}": role for number, role in enumerate(JOINTS, 1)}
_UNITS = {**dict.fromkeys("xyz", MILLIMETRE), **dict.fromkeys(("alpha", "beta", "gamma", *JOINTS), DEGREE)}
_ONE = re.compile(r"[^.\[]*(\[\d*\])?")  # the name of one value, of an array with its number
_FOLLOWED = {"$TOOL", "$BASE", "$LOAD", "FDAT_ACT"}  # to which a program gives values that are read
_NULL = {0, -1}  # numbers of the flange as tool and of the world as base


@dataclass(frozen=True)
class _State:
    """Tool and base where the text has arrived; None where nothing has said them."""

    tool: Frame | None = None
    base: Frame | None = None
    load: float | None = None  # kg
    load_unread: str = ""  # why it may be another one
    is_at_rest: bool = False  # whether the tool stands still and the robot carries the workpiece


@dataclass
class _Place:
    """A target on its way to become one."""

    name: str
    line: Line
    numbers: dict[str, Literal]
    uses: list[tuple[Line, _State]] = field(default_factory=list)


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
        self._values: dict[str, Value] = {}  # TOOL_DATA[1], FP1, ... by capital name
        self._given: dict[str, list[Value]] = {}  # all that stand in the files, by the same names
        self._changed: set[str] = set()  # names of what the program changes
        self._places: dict[str, list[_Place]] = {}
        self._inline: list[_Place] = []
        self._state = _State()
        self._course = Course()

    def program(self) -> Program:
        """The targets with their frames."""
        files = [code_lines(each) for each in (self._source, *self._context.others)]
        for lines in reversed(files):
            for line in lines:
                self._declare(line)
        for line in (line for lines in files for line in lines):
            self._changed |= {_changed(line)} - {""}
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

    def _note(self, line: Line, text: str) -> None:
        if line.source is self._source:
            self._notes.append(Note(line.number, text))

    def _declare(self, line: Line) -> None:
        match = _PLACED.match(line.code)
        if not match or match["part"] or not match["value"].startswith("{"):
            return
        spelled = re.sub(r"\s", "", match["name"])
        name, value = spelled.upper(), aggregate(line, match.start("value"))
        if not _ONE.fullmatch(name):
            return
        self._values[name] = value
        self._given.setdefault(name, []).append(value)
        if name.startswith("$") or "_DATA[" in name:
            return
        kind = (match["type"] or "").strip().upper()
        roles = _roles(value)
        if roles:
            self._places.setdefault(name, []).append(_Place(spelled, line, roles))
        elif kind in ("E6POS", "POS", "E6AXIS", "AXIS"):
            self._note(line, f"{spelled} is not given in numbers alone, left alone")

    def _follow(self, line: Line) -> None:
        """Takes from a line where it moves, and with what."""
        suggested = _SUGGESTED.match(line.code)
        if suggested:
            kind, number = suggested[1].upper(), int(suggested[2])
            self._state = replace(self._state, **{kind.lower(): self._numbered(kind, number, line)})
            if kind == "TOOL":
                self._state = self._with_load(self._state, number, line)
        match = _PLACED.match(line.code)
        if match:
            name = re.sub(r"\s", "", match["name"]).upper() + match["part"]
            self._assign(line, name, match["value"].strip(), match.start("value"))
            return
        match = _MOVE.match(line.code)
        if match and match["relative"]:
            self._note(line, "moves by a distance from where the robot is, left alone")
            self._go(line, None, "moves by a distance from where the robot is, which is not followed")
        elif match:
            self._move(line, match.end())

    def _assign(self, line: Line, name: str, value: str, at: int) -> None:
        if name.startswith(("$TOOL.", "$BASE.")):
            raise ProgramError(f"{line.where}: {name} = {value} changes a part of a frame, which is not read")
        if name in ("$TOOL", "$BASE"):
            frame = self._frame_value(line, name, value, at)
            self._state = replace(self._state, **{name[1:].lower(): frame})
            number = re.fullmatch(r"TOOL_DATA\[\s*(\d+)\s*\]", value, re.IGNORECASE)
            if number:
                self._state = self._with_load(self._state, int(number[1]), line)
        elif name == "$IPO_MODE":
            self._state = replace(self._state, is_at_rest=value.upper() == "#TCP")
        elif name == "$LOAD":
            found = aggregate(line, at) if value.startswith("{") else self._values.get(value.upper())
            mass = found.numbers.get("M") if found else None
            if mass is None:
                raise ProgramError(f"{line.where}: the mass of {value} is not known; --with FILE reads it")
            unread = "" if value.startswith("{") else self._unread(value.upper(), line)
            self._state = replace(self._state, load=mass.value, load_unread=unread)
        elif name.upper() == "$LOAD.M":
            self._state = replace(self._state, load_unread=_not_read(name))
        elif name == "FDAT_ACT" and value.upper() in self._values:
            found = self._of_fdat(self._values[value.upper()])
            self._state = found or replace(self._state, is_at_rest=True)
        elif name := _changed(line):
            self._course.assign(name)
            for each in [each for each in self._places if _is_of(each, name)]:
                self._course.assign(each)
                for place in self._places.pop(each):
                    self._note(place.line, f"{place.name} is given another value by the program, left alone")

    def _declared(self, name: str, line: Line) -> Value | None:
        """What declarations say of a frame; None if they say nothing. Raises ProgramError if it changes."""
        if unread := self._unread(name, line):
            raise ProgramError(f"{line.where}: {unread}")
        return self._values.get(name)

    def _unread(self, name: str, line: Line) -> str:
        """That the program changes a value that a line uses; empty if it does not."""
        is_changed = any(_is_of(name, each) for each in self._changed) or self._is_given_anew(name, line)
        return _not_read(name) if is_changed else ""

    def _is_given_anew(self, name: str, line: Line) -> bool:
        """Whether a value is given more than once, not all the same, and not just before a line uses it."""
        given = self._given.get(name, [])
        if all(each.says == given[0].says for each in given):
            return False
        here = [each for each in given if each.line.source is line.source]
        return not (
            here
            and all(each.says == here[0].says for each in here)
            and here[0].line.number < line.number
            and self._values[name] in here
        )

    def _frame_value(self, line: Line, name: str, value: str, at: int) -> Frame:
        if value.upper() in ("$NULLFRAME", "$WORLD"):
            return Frame("$NULLFRAME", np.eye(4))
        if value.startswith("{"):
            return Frame(name, _pose(aggregate(line, at), name))
        number = re.fullmatch(r"(TOOL|BASE)_DATA\[\s*(-?\d+)\s*\]", value, re.IGNORECASE)
        if number:
            return self._numbered(number[1].upper(), int(number[2]), line)
        declared = self._declared(value.upper(), line)
        if declared:
            return Frame(value, _pose(declared, value))
        raise ProgramError(f"{line.where}: {name} = {value} cannot be read; --with FILE reads further files")

    def _numbered(self, kind: str, number: int, line: Line) -> Frame:
        """TOOL_DATA[n] or BASE_DATA[n]."""
        name = f"{kind}_DATA[{number}]"
        if number in _NULL:
            return Frame(name, np.eye(4))
        declared = self._declared(name, line)
        if declared is None:
            raise ProgramError(f"{line.where}: {name} is not declared; --with $config.dat reads it")
        return Frame(name, _pose(declared, name))

    def _with_load(self, state: _State, number: int, line: Line) -> _State:
        """With what the controller knows to hang at the flange with a tool."""
        name = f"LOAD_DATA[{number}]"
        value = self._values.get(name)
        mass = value.numbers.get("M") if value else None
        load = mass.value if mass and mass.value >= 0.0 else None
        return replace(state, load=load, load_unread=self._unread(name, line))

    def _of_fdat(self, value: Value) -> _State | None:
        """Tool and base of a target; None if the tool stands still."""
        if value.texts.get("IPO_FRAME", "").upper() == "#TCP":
            return None
        tool, base = value.number("TOOL_NO"), value.number("BASE_NO")
        frames = self._numbered("TOOL", tool, value.line), self._numbered("BASE", base, value.line)
        return self._with_load(_State(*frames), tool, value.line)

    def _move(self, line: Line, at: int) -> None:
        """The places that a motion names or holds; two of them in a circle."""
        is_circle, arrival, why = "CIRC" in line.code[:at].upper(), None, ""
        spans = parts(line.code, at, len(line.code))
        for start, end in spans[: 2 if is_circle else 1]:
            at = start + len(line.code[start:end]) - len(line.code[start:end].lstrip())
            places, name = [], _NAME.match(line.code, at, end)
            if line.code[at:end].startswith("{"):
                roles, at = _roles(aggregate(line, at)), closing(line, at)
                if not roles:
                    self._note(line, "gives parts of a pose, or expressions, left alone")
                elif line.source is self._source:
                    self._inline.append(_Place("", line, roles))
                    arrival, places = self._inline[-1], self._inline[-1:]
            elif name:
                at = name.end()
                whole = name[1].upper()
                places = [each for key in self._places if _is_of(key, whole) for each in self._places[key]]
                arrival = places[0] if len(places) == 1 and whole in self._places else None
            if line.code[at:end].lstrip().startswith(":"):
                self._note(line, "moves beside the target, by a sum of frames: shifted with it, no more")
                why = "moves beside the target, by a sum of frames, which is not followed"
            for place in places:
                place.uses.append((line, self._state))
        start, end = spans[0]
        text = re.sub(r"\s+C_\w+\s*$", "", line.code[start:end])
        self._go(line, arrival, why, text)

    def _go(self, line: Line, place: _Place | None, why: str, text: str = "") -> None:
        """Takes a motion into the course of the file; ``text`` is where to, ``why`` it is not followed."""
        if line.source is not self._source:
            return
        fdat = self._fdat(place) if place else None
        state = self._of_fdat(fdat) if fdat else self._state
        if state is None or state.is_at_rest:
            why = why or "belongs to a tool that stands still, which is not followed"
        state = state or self._state
        has_tool = place is not None and ("q1" in place.numbers or state.tool is not None)
        why = why or not_followed(line.code, text, place is not None, has_tool)
        numbers = place.numbers if place else {}
        target = Target(place.name if place else "", line.number, numbers, state.tool, state.base or WORLD)
        self._course.move(line.number, target if place else None, is_straight(line.code), why)

    def _fdat(self, place: _Place) -> Value | None:
        """The frame data that belong to a taught target."""
        name = place.name.upper()
        value = self._values.get(f"F{name[1:]}") if name.startswith("X") else None
        return value if value and "TOOL_NO" in value.numbers else None

    def _target(self, place: _Place) -> Target | None:
        """The target with its frames; None where nothing says its tool."""
        fdat = self._fdat(place)
        if fdat:
            state = self._of_fdat(fdat)
            uses = [(fdat.line, state or _State(is_at_rest=True))]
        else:
            uses = place.uses
        if any(state.is_at_rest for _, state in uses):
            name = place.name or "the target"
            self._note(place.line, f"{name} belongs to a tool that stands still, left alone")
            return None
        uses = [(line, state) for line, state in uses if state.tool is not None]
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
        unread = next((state.load_unread for _, state in uses if state.load_unread), "")
        base = first.base or WORLD
        return Target(place.name, place.line.number, place.numbers, first.tool, base, payloads, unread)

    def _by_default(self, line: Line) -> _State:
        for option, text in (("--tool", self._context.tool), ("--base", self._context.base or "0")):
            if not re.fullmatch(r"-?\d+", text):
                raise ProgramError(f"{option} must be a number in KRL, got '{text}'")
        tool = int(self._context.tool)
        base = self._numbered("BASE", int(self._context.base or "0"), line)
        return self._with_load(_State(self._numbered("TOOL", tool, line), base), tool, line)


def _not_read(name: str) -> str:
    return f"{name} is given another value by the program, which is not read"


def _changed(line: Line) -> str:
    """The capital name of what a line gives a value that is not read; empty if it does not."""
    match = _PLACED.match(line.code)
    name = re.sub(r"\s", "", match["name"]).upper() if match else ""
    if not match or name in _FOLLOWED:
        return ""
    is_read = match["value"].startswith("{") and not match["part"] and bool(_ONE.fullmatch(name))
    return "" if is_read else name


def _is_of(each: str, name: str) -> bool:
    """Whether a capital name is meant by another one, which may be any of an array if it computes which."""
    is_any = not _ONE.fullmatch(name)
    return each == name or (is_any and each.partition("[")[0] == name.partition("[")[0])


def _roles(value: Value) -> dict[str, Literal]:
    """The literals of a whole pose or of all six axes by their roles; empty for anything else."""
    for keys in (_CARTESIAN, _AXES):
        if all(key in value.numbers for key in keys):
            extra = _TURNS if keys is _CARTESIAN else {}
            roles = {role: value.numbers[key] for key, role in (keys | extra).items() if key in value.numbers}
            return {role: replace(each, unit=_UNITS.get(role, 1.0)) for role, each in roles.items()}
    return {}


def _pose(value: Value, name: str) -> np.ndarray:
    roles = _roles(value)
    if "x" not in roles:
        raise ProgramError(f"{value.line.where}: {name} must be given in numbers")
    zyx = np.array([roles[role].si for role in ("alpha", "beta", "gamma")])
    return homogeneous([roles[role].si for role in "xyz"], rotation_from_zyx(zyx))
