"""How RAPID steers through its moves: routines, conditions, loops, calls, and which instructions move how."""

from collections.abc import Sequence

from robots.programs.course import Course
from robots.programs.program import Source, Target
from robots.programs.rapid_text import KEYWORDS, Token

_BLOCKS = {"for": "endfor", "while": "endwhile", "test": "endtest"}
_ENDS = {"endif", *_BLOCKS.values()}
_LEAVES = {"return", "raise", "exit", "exitcycle", "error", "undo", "backward", "retry", "trynext"}
_BEFORE_CALL = {"then", "else", "do", "proc", *_ENDS, "endproc", "endfunc", "endtrap"}  # keywords
_HARMLESS = {  # instructions of RAPID itself that have no arguments and move nothing
    *("stop", "break", "pdispoff", "eoffsoff", "softdeact", "stopmove", "startmove", "storepath"),
    *("restopath", "clearpath", "exitcycle", "tperase", "waittestandset", "idisable", "ienable"),
}
_SUFFIXES = ("", "do", "ao", "go", "sync")
_STRAIGHT = {
    **dict.fromkeys((f"movel{suffix}" for suffix in _SUFFIXES), True),
    **dict.fromkeys((f"movej{suffix}" for suffix in _SUFFIXES), False),
    **{"moveabsj": False, "triggl": True, "triggj": False},
}
_OTHER_MOVES = {"triggc", "searchl", "searchc", "searchextj", "arcl", "arcc", "arclstart", "arclend"}


def is_motion(name: str) -> bool:
    """Whether an instruction, in small letters, moves the robot wherever its target is."""
    return name.startswith("move") or name in _STRAIGHT or name in _OTHER_MOVES


def is_straight(name: str) -> bool:
    """Whether the tool goes along a line; else the joints go in proportion."""
    return bool(_STRAIGHT.get(name))


def not_followed(name: Token, part: Sequence[Token], target: Target | None) -> str:
    """Why an instruction with a target that an argument says, if it does, is not followed; empty if it is."""
    if name.word not in _STRAIGHT:
        return f"{name.text} is not followed, only MoveAbsJ, MoveJ and MoveL are"
    if target is None:
        to = "".join(token.text for token in part)
        return f"{name.text} goes to {to}, which is no target given in numbers in this file"
    return "" if target.has_joints or target.tool else f"{name.text} names no tool"


def steer(course: Course, source: Source, statement: Sequence[Token]) -> bool:
    """Follows the keywords of a statement, which all stand before its instruction.

    Returns:
        Whether it is an IF without THEN, which ends with the statement and is to be closed then.
    """
    words = [token.word if token.kind == "name" else "" for token in statement]
    is_brief = False
    for at, (token, word) in enumerate(zip(statement, words, strict=True)):
        line = source.line(token.start)
        if word in ("proc", "func", "trap"):
            place = at + (2 if word == "func" else 1)  # a function has its type before its name
            course.begin("".join(words[place : place + 1]))
            if word == "trap":
                course.open(word, line)
        elif word == "if" or word in _BLOCKS:
            course.open(word, line)
            is_brief = is_brief or (word == "if" and "then" not in words[at:])
        elif word in _ENDS:
            course.close()
        elif word in _LEAVES:
            course.leave(word, line)
        elif word == "goto":
            course.jump(line)
    return is_brief


def note_call(course: Course, source: Source, statement: Sequence[Token]) -> None:
    """Takes from a statement that has no arguments which routine it calls."""
    if not statement:
        return
    token, before = statement[-1], statement[-2] if len(statement) > 1 else None
    line = source.line(token.start)
    if token.text == "%":
        course.move(line, None, why_not="calls a routine whose name is an expression")
    if token.kind != "name" or token.word in KEYWORDS | _HARMLESS:
        return
    is_if = any(each.word == "if" for each in statement)
    follows_word = before is not None and before.kind == "name" and before.word in KEYWORDS
    if (before is None or before.text in (":", ")")) or (
        before.word in _BEFORE_CALL if follows_word else is_if and before.kind in ("name", "number", "string")
    ):
        course.call(token.word, line)
