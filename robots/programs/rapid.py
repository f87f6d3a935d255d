"""Programs of ABB controllers: modules in RAPID with ``robtarget`` and ``jointtarget``.

The tool, the work object and the loads of a target are those of the instructions that move to it, grippers
(``GripLoad``) in the order of the text. What is an expression in place of numbers is left alone and named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from robots.programs.course import Course
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
    declared_pose,
    quaternion_problem,
)
from robots.programs.rapid_course import is_motion, is_straight, not_followed, note_call, steer
from robots.programs.rapid_text import (
    KEYWORDS,
    Other,
    Token,
    Tree,
    aggregate,
    assigned,
    has_shape,
    is_argument,
    literals,
    split,
    statements,
    why_unread,
    without_heading,
    without_short_condition,
)

_POSE_ROLES = ("x", "y", "z", "qw", "qx", "qy", "qz", "cf1", "cf4", "cf6", "cfx")
_POSE_UNITS = (*(MILLIMETRE,) * 3, *(1.0,) * 8)
# Which argument of an instruction is the tool, where its name is not declared; the others are found by name.
_TOOL_PLACE = {
    **dict.fromkeys(("movej", "movel", "moveabsj", "moveldo", "movejdo", "movelsync", "movejsync"), 3),
    **dict.fromkeys(("movec", "movecdo", "movecsync", "triggl", "triggj", "searchl"), 4),
    **dict.fromkeys(("triggc", "searchc", "arcl", "arclstart", "arclend"), 5),
}
_SHIFTED = {"offs", "reltool"}  # functions that give a target beside another
_DISPLACING = {"pdispon", "pdispset", "eoffson", "eoffsset"}
_KINDS = ("robtarget", "jointtarget", "tooldata", "wobjdata", "loaddata")
_TOOL0 = Frame("tool0", np.eye(4))


@dataclass
class _Declared:
    """A value of one of `_KINDS` with a name."""

    kind: str
    name: str
    tree: Tree
    source: Source
    line: int


@dataclass(frozen=True)
class _Use:
    """One instruction that moves to a target."""

    line: str
    tool: Frame | None
    base: Frame
    payload: float
    load_unread: str = ""  # why it may be another one


@dataclass
class _Place:
    """A target on its way to become one."""

    name: str
    line: int
    numbers: dict[str, Literal]
    uses: list[_Use] = field(default_factory=list)

    def start(self) -> int:
        """Where in the text its first number is."""
        return min(each.start for each in self.numbers.values())


def read_rapid(source: Source, context: ProgramContext) -> Program:
    """Reads a module.

    Raises:
        ProgramError: if a tool, work object or load is not declared or cannot be read, or if one target is
            moved to with several of them.
    """
    return _Reader(source, context).program()


class _Reader:
    """One module with what others declare."""

    def __init__(self, source: Source, context: ProgramContext) -> None:
        self._source, self._context = source, context
        self._notes: list[Note] = []
        self._declared: dict[str, _Declared] = {}
        self._places: dict[str, list[_Place]] = {}  # by the small letters of the name
        self._inline: list[_Place] = []
        self._changed: set[str] = set()  # names, in small letters
        self._gripped, self._gripped_unread = 0.0, ""
        self._course = Course()
        self._parsed = [(each, list(statements(each))) for each in (source, *context.others)]

    def program(self) -> Program:
        """The targets with their frames."""
        for source, found in reversed(self._parsed):  # the module itself last: its own names count
            for statement in found:
                self._declare(source, statement)
        for declared in list(self._declared.values()):
            if declared.kind in _KINDS[:2] and declared.source is self._source:
                places = self._places_of(declared.name, declared.line, declared.tree)
                if places:
                    self._places[declared.name.lower()] = places
        names = (assigned(_done(statement)) for _, found in self._parsed for statement in found)
        self._changed = {name.word for name in names if name}
        for source, found in self._parsed:
            self._gripped, self._gripped_unread = 0.0, ""
            for statement in found:
                is_brief = source is self._source and steer(self._course, source, statement)
                self._follow(source, statement)
                if is_brief:
                    self._course.close()
        places = [place for group in self._places.values() for place in group] + self._inline
        places.sort(key=_Place.start)
        targets = [target for target in map(self._target, places) if target is not None]
        notes = sorted(set(self._notes), key=lambda note: note.line)
        return Program(
            self._source.name, self._source.text, tuple(targets), tuple(notes), self._course.moves()
        )

    def _note(self, source: Source, line: int, text: str) -> None:
        if source is self._source:
            self._notes.append(Note(line, text))

    # Declarations

    def _declare(self, source: Source, statement: Sequence[Token]) -> None:
        statement = without_heading(statement)
        for at, token in enumerate(statement):
            if token.word in ("const", "pers", "var") and len(statement) > at + 2:
                kind, name = statement[at + 1].word, statement[at + 2]
                parts = split(statement[at + 3 :], ":=")
                if kind in _KINDS and len(parts) == 2:
                    line = source.line(name.start)
                    value = _Declared(kind, name.text, aggregate(parts[1][1]), source, line)
                    self._declared[name.word] = value
                return

    def _places_of(self, name: str, line: int, tree: Tree) -> list[_Place]:
        """The targets in the value of a declaration, of an array more than one."""
        numbers = _target_numbers(tree)
        if numbers:
            return [_Place(name, line, numbers)]
        if isinstance(tree, list) and tree and not has_shape(tree, *map(_length, tree)):
            return [
                place
                for number, part in enumerate(tree, 1)
                for place in self._places_of(f"{name}{{{number}}}", line, part)
            ]
        self._note(self._source, line, f"{name} {why_unread(tree)}, left alone")
        return []

    def _frame(self, name: str, where: str) -> Frame:
        """A declared tool in the flange, or a work object in the world."""
        if name.lower() in ("tool0", "wobj0"):
            return _TOOL0 if name.lower() == "tool0" else WORLD
        declared = self._declared.get(name.lower())
        if declared is None:
            raise ProgramError(f"{where}: {name} is not declared; --with FILE reads further modules")
        if unread := self._unread(name):
            raise ProgramError(f"{where}: {unread}")
        tree, at = declared.tree, declared.source.where(declared.line)
        is_tool = declared.kind == "tooldata"
        frames = []
        if isinstance(tree, list) and len(tree) == (3 if is_tool else 5):
            frames = [literals(part, 3, 4) for part in (tree[1:2] if is_tool else tree[3:])]
        if not isinstance(tree, list) or not frames or None in frames:
            raise ProgramError(f"{at}: {name} must be given in numbers, it holds expressions")
        if _flag(tree[0]) is not is_tool:
            raise ProgramError(f"{at}: {name} is of a tool that stands still, which cannot be compensated")
        if not is_tool and not _flag(tree[1]):
            raise ProgramError(f"{at}: {name} is moved by a mechanical unit, which cannot be compensated")
        X = np.eye(4)
        for rows in filter(None, frames):
            X = X @ declared_pose(rows[0], rows[1], f"{at}: {name}")
        return Frame(name, X)

    def _unread(self, name: str) -> str:
        """That the program changes a value; empty if it does not."""
        is_changed = name.lower() in self._changed
        return f"{name} is given another value by the program, which is not read" if is_changed else ""

    def _mass(self, name: str, where: str) -> float:
        """Of a load, or of a tool, in kg."""
        if name.lower() in ("tool0", "load0"):
            return 0.0
        declared = self._declared.get(name.lower())
        tree = declared.tree if declared else None
        load = tree[2] if isinstance(tree, list) and len(tree) == 3 else tree
        mass = load[0] if isinstance(load, list) and load else None
        if not isinstance(mass, Literal):
            raise ProgramError(
                f"{where}: the mass of {name} is not declared in numbers; --with FILE reads it"
            )
        return mass.value

    # Instructions

    def _follow(self, source: Source, statement: Sequence[Token]) -> None:
        """Takes from a statement where it moves, and with what."""
        statement = _done(statement)
        if name := assigned(statement):
            return self._assigned(name)
        for at, (token, after) in enumerate(pairwise(statement)):
            if token.kind == "name" and token.word not in KEYWORDS and is_argument(after):
                self._instruction(source, token, statement[at + 1 :])
                return
        if source is self._source:
            note_call(self._course, source, statement)

    def _assigned(self, name: Token) -> None:
        self._course.assign(name.word)
        for place in self._places.pop(name.word, []):
            text = f"{place.name} is given another value by the program, left alone"
            self._note(self._source, place.line, text)

    def _instruction(self, source: Source, name: Token, arguments: Sequence[Token]) -> None:
        line = source.line(name.start)
        where = source.where(line)
        positional, options = [], {}
        for sign, part in split(arguments, ",", "\\"):
            if sign == "\\" and part:
                options[part[0].word] = part[2:]
            elif part:
                positional.append(part)
        if name.word == "gripload" and positional:
            part = positional[0][0].text
            self._gripped, self._gripped_unread = self._mass(part, where), self._unread(part)
        if name.word in _DISPLACING:
            text = f"{name.text} displaces what follows, which is not taken into account"
            self._note(source, line, text)
            if source is self._source:
                self._course.move(line, None, why_not=text)
        places = [place for part in positional for place in self._moved_to(source, line, name.word, part)]
        if not places:
            self._moves(source, line, name, positional, None)
            return
        tool = self._tool_of(name.word, positional, where)
        base, payload, unread = WORLD, self._gripped, self._gripped_unread
        if options.get("wobj"):
            base = self._frame(options["wobj"][0].text, where)
        if options.get("tload"):
            part = options["tload"][0].text
            payload, unread = self._mass(part, where), self._unread(part)
        elif tool is not None:
            payload += self._mass(tool.name, where)
        use = _Use(where, tool, base, payload, unread)
        for place in places:
            place.uses.append(use)
        self._moves(source, line, name, positional, use)

    def _moves(
        self, source: Source, line: int, name: Token, positional: Sequence[Sequence[Token]], use: _Use | None
    ) -> None:
        """Takes an instruction into the course of the module; ``use`` is None if no target is in it."""
        if source is not self._source:
            return
        if not is_motion(name.word) and use is None:
            self._course.call(name.word, line, may_move=False)
            return
        part = positional[0] if positional else []
        place = self._arrival(part)
        tool, base = (use.tool, use.base) if use else (None, WORLD)
        target = Target(place.name, line, place.numbers, tool, base) if place else None
        self._course.move(line, target, is_straight(name.word), not_followed(name, part, target))

    def _arrival(self, part: Sequence[Token]) -> _Place | None:
        """The one target that an argument names, as it is or as the pose of a jointtarget, or holds."""
        if len(part) > 3 and part[0].word == "calcrobt" and part[3].text == ",":
            part = part[2:3]
        if part and part[0].text == "[":
            return next((each for each in self._inline[-1:] if each.start() > part[0].start), None)
        name = "".join(token.word for token in part)
        group = self._places.get(part[0].word, []) if part else []
        return next((place for place in group if place.name.lower() == name), None)

    def _tool_of(self, name: str, positional: Sequence[Sequence[Token]], where: str) -> Frame | None:
        for part in positional:
            declared = self._declared.get(part[0].word)
            if len(part) == 1 and (part[0].word == "tool0" or (declared and declared.kind == "tooldata")):
                return self._frame(part[0].text, where)
        place = _TOOL_PLACE.get(name)
        if place is not None and place < len(positional):
            return self._frame(" ".join(token.text for token in positional[place]), where)
        return None

    def _moved_to(self, source: Source, line: int, name: str, part: Sequence[Token]) -> list[_Place]:
        """The targets that an argument names or holds."""
        first = part[0]
        if first.kind == "name" and (len(part) == 1 or part[1].text == "{"):
            return self._places.get(first.word, [])
        if first.word in _SHIFTED and len(part) > 2:
            beside = self._places.get(part[2].word, [])
            if beside:
                text = f"{first.text} of {beside[0].name}: shifted with it, not corrected by itself"
                self._note(source, line, text)
            return beside
        if first.text == "[":
            tree = aggregate(part)
            if has_shape(tree, 3, 4, 4, 6) or has_shape(tree, 6, 6):
                numbers = _target_numbers(tree)
                if numbers is None:
                    self._note(source, line, f"the target of {name} {why_unread(tree)}, left alone")
                elif source is self._source:
                    self._inline.append(_Place("", line, numbers))
                    return self._inline[-1:]
        return []

    # Targets

    def _target(self, place: _Place) -> Target | None:
        """The target with its frames; None where nothing says its tool."""
        if problem := quaternion_problem(place.numbers):
            return self._note(self._source, place.line, f"{place.name or 'a target'}: {problem}, left alone")
        where = self._source.where(place.line)
        uses = [use for use in place.uses if use.tool is not None]
        if not uses and not self._context.tool:
            text = f"{place.name} is not moved to with a tool that is named; --tool NAME says it, left alone"
            self._note(self._source, place.line, text)
            return None
        if not uses:
            tool = self._frame(self._context.tool, "--tool")
            base = self._frame(self._context.base, "--base") if self._context.base else WORLD
            uses = [_Use(where, tool, base, self._mass(tool.name, where))]
        first = uses[0]
        for use in uses[1:]:
            for a, b in ((use.tool, first.tool), (use.base, first.base)):
                assert a is not None
                assert b is not None
                if not np.allclose(a.X, b.X, rtol=0.0, atol=1e-12):
                    raise ProgramError(
                        f"{use.line}: {place.name or 'the target'} is moved to with {a.name}, and with "
                        f"{b.name} in {first.line}: no single place is right for both"
                    )
        payloads = tuple(sorted({use.payload for use in uses}))
        unread = next((use.load_unread for use in uses if use.load_unread), "")
        return Target(place.name, place.line, place.numbers, first.tool, first.base, payloads, unread)


def _target_numbers(tree: Tree) -> dict[str, Literal] | None:
    """The literals of a robtarget or jointtarget by their roles; external axes may be anything."""
    if has_shape(tree, 3, 4, 4, 6):
        assert isinstance(tree, list)
        rows = literals(tree[:3], 3, 4, 4)
        if rows is None or not any(each.value for each in rows[1]):
            return None
        flat = [literal for row in rows for literal in row]
        units = zip(_POSE_ROLES, flat, _POSE_UNITS, strict=True)
        return {role: replace(literal, unit=unit) for role, literal, unit in units}
    if has_shape(tree, 6, 6):
        assert isinstance(tree, list)
        rows = literals(tree[:1], 6)
        if rows is None:
            return None
        return {role: replace(each, unit=DEGREE) for role, each in zip(JOINTS, rows[0], strict=True)}
    return None


def _done(statement: Sequence[Token]) -> Sequence[Token]:
    """What a statement does, without a heading or short condition; nothing if it declares."""
    statement = without_heading(statement)
    if any(token.word in ("const", "pers", "var") for token in statement):
        return ()
    return without_short_condition(statement)


def _length(tree: Tree) -> int:
    return len(tree) if isinstance(tree, list) else -1


def _flag(tree: Tree) -> bool:
    return isinstance(tree, Other) and tree.text.lower() == "true"
