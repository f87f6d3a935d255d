"""How KRL steers through its moves: routines, conditions, loops, calls, and which motions are followed."""

import re

from robots.programs.course import Course

_BEGIN = re.compile(r"\s*(?:GLOBAL\s+)?DEF(?:FCT\s+\w+(?:\[\])?)?\s+(\w+)\s*\(", re.IGNORECASE)
_WORD = re.compile(r"\s*(\w+)\b")
_CALL = re.compile(r"\s*([A-Z_]\w*)\s*\(", re.IGNORECASE)
_BLOCKS = {"IF", "FOR", "WHILE", "REPEAT", "LOOP", "SWITCH", "SPLINE", "PTP_SPLINE"}
_ENDS = {"ENDIF", "ENDFOR", "ENDWHILE", "UNTIL", "ENDLOOP", "ENDSWITCH", "ENDSPLINE"}
_HARMLESS = {"BAS", "PULSE"}  # routines of KUKA itself that a program may call, and that move nothing
_NO_CALL = {"WAIT", "CASE", "ELSE", "DEFAULT", "RETURN"} | _BLOCKS | _ENDS
_STRAIGHT = {"PTP": False, "SPTP": False, "LIN": True, "SLIN": True}


def steer(course: Course, line: int, code: str) -> None:
    """Follows what a line says of the way through the program, and whom it calls."""
    begin, first, call = _BEGIN.match(code), _WORD.match(code), _CALL.match(code)
    word = first[1].upper() if first else ""
    if begin:
        course.begin(begin[1].upper())
    elif word in _BLOCKS:
        course.open(word, line)
    elif word in _ENDS:
        course.close()
    elif word == "GOTO":
        course.jump(line)
    elif word == "RETURN":
        course.leave(word, line)
    elif call and word not in _NO_CALL | _HARMLESS:
        course.call(word, line)


def is_straight(code: str) -> bool:
    """Whether the tool of a motion goes along a line; else the joints go in proportion."""
    return bool(_STRAIGHT.get(_kind(code)))


def not_followed(code: str, text: str, has_target: bool, has_tool: bool) -> str:
    """Why a motion to what a text says is not followed; empty if it is."""
    if _kind(code) not in _STRAIGHT:
        return f"{_kind(code)} is not followed, only PTP, SPTP, LIN and SLIN are"
    if not has_target:
        return (
            f"{_kind(code)} goes to {text.strip()}, which is no target given in numbers; --with FILE reads it"
        )
    return "" if has_tool else f"nothing says the tool with which {_kind(code)} goes to {text.strip()}"


def _kind(code: str) -> str:
    match = _WORD.match(code)
    return match[1].upper() if match else ""
