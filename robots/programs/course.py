"""Which moves a program makes, one after the other, as far as its text alone says so.

Whoever reads a program tells what there is in the order of the text. Moves all stand in one routine, outside
of conditions and loops; what is otherwise is named, for to leave out a move is to take another way in space.
"""

from dataclasses import dataclass

from robots.programs.program import Move, Target


@dataclass(frozen=True)
class _Call:
    """A call of a routine by another one."""

    caller: str
    name: str
    line: int
    unsure: str  # why it may not be made once; empty where it is
    may_move: bool  # if the routine is not in the file


class Course:
    """The moves of one file."""

    def __init__(self) -> None:
        """Begins outside of all routines."""
        self._routine, self._left, self._open = "", "", list[str]()
        self._defined: set[str] = set()
        self._moves: list[tuple[str, Move]] = []  # with their routines
        self._calls: list[_Call] = []
        self._assigned: set[str] = set()
        self._jumps: dict[str, int] = {}  # lines, by the routine

    def begin(self, routine: str) -> None:
        """A routine begins; its name in letters that are all small, or all large."""
        self._routine, self._left, self._open = routine, "", []
        self._defined.add(routine)

    def open(self, word: str, line: int) -> None:
        """Something begins that is gone through under a condition, or several times."""
        self._open.append(f"{word.upper()} of line {line}")

    def close(self) -> None:
        """What was opened last ends."""
        if self._open:
            self._open.pop()

    def leave(self, word: str, line: int) -> None:
        """The routine may be left here, so that what follows may not be reached."""
        self._left = f"{word.upper()} of line {line}"

    def jump(self, line: int) -> None:
        """The routine goes on elsewhere."""
        self._jumps.setdefault(self._routine, line)

    def assign(self, name: str) -> None:
        """The program changes a target."""
        self._assigned.add(name.upper())

    def move(self, line: int, target: Target | None, is_straight: bool = False, why_not: str = "") -> None:
        """The program moves."""
        found = Move(line, target, is_straight, why_not or self._unsure())
        self._moves.append((self._routine, found))

    def call(self, name: str, line: int, may_move: bool = True) -> None:
        """The program calls a routine; ``may_move`` says whether one of another file could move."""
        self._calls.append(_Call(self._routine, name, line, self._unsure(), may_move))

    def moves(self) -> tuple[Move, ...]:
        """All moves in the order of the text; what may not be made there, and once, has the reason."""
        if not self._moves:
            return ()
        routine = self._moves[0][0]
        found = [self._judged(routine, *each) for each in self._moves]
        found += [
            Move(call.line, None, why_not=f"calls {call.name}, which is not in this file and may move")
            for call in self._calls
            if call.may_move and call.name not in self._defined
        ]
        return tuple(sorted(found + self._misled(routine), key=lambda move: move.line))

    def _judged(self, first: str, routine: str, move: Move) -> Move:
        why = ""
        if routine in self._jumps:
            why = f"GOTO of line {self._jumps[routine]} changes the order of moves, which is not read"
        elif routine != first:
            why = f"moves stand in {first} and in {routine}; put all of them into one routine"
        elif move.target and move.target.name.split("{")[0].upper() in self._assigned:
            why = f"{move.target.name} is given another value by the program"
        return Move(move.line, None, why_not=why) if why and not move.why_not else move

    def _misled(self, routine: str) -> list[Move]:
        """Calls of the routine that moves, and of those that call it, if it is not called once."""
        found, seen = [], {""}
        while routine not in seen:
            seen.add(routine)
            calls = [call for call in self._calls if call.name == routine]
            found += [Move(call.line, None, why_not=call.unsure) for call in calls[:1] if call.unsure]
            found += [Move(call.line, None, why_not=f"calls {call.name} once more") for call in calls[1:]]
            routine = calls[0].caller if calls else ""
        return found

    def _unsure(self) -> str:
        if self._open:
            return f"stands within {self._open[-1]}: whether it is made, and how often, is not read"
        return f"stands behind {self._left}: whether it is made is not read" if self._left else ""
