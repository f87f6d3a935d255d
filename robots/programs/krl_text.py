"""The text of KUKA's KRL: lines of code without comments, and aggregates such as ``{X 600, Y 0, Z 800}``."""

import re
from dataclasses import dataclass

from robots.programs.program import Literal, ProgramError, Source

_NUMBER = re.compile(r"[+-]?\s*(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_KEY = re.compile(r"\s*([A-Z]\w*)(?:\[\])?\s+", re.IGNORECASE)


@dataclass(frozen=True)
class Line:
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
class Value:
    """An aggregate ``{X 1, Y 2}``: its literals, and the text of everything else, by the capital key."""

    line: Line
    numbers: dict[str, Literal]
    texts: dict[str, str]

    @property
    def says(self) -> tuple[dict[str, float], dict[str, str]]:
        """Its content, wherever it stands."""
        return {key: each.value for key, each in self.numbers.items()}, self.texts

    def number(self, key: str) -> int:
        """An integer in it. Raises ProgramError if it is not there."""
        if key not in self.numbers:
            raise ProgramError(f"{self.line.where}: {key} must be a number")
        return int(self.numbers[key].value)


def code_lines(source: Source) -> list[Line]:
    """The code of every line."""
    found, start = [], 0
    for number, text in enumerate(re.split(r"(?<=\n)|(?<=\r)(?!\n)", source.text), 1):
        # What stands between quotes is no code: blanks in its place keep all characters where they are.
        quiet = re.sub(r'"[^"\r\n]*"', lambda match: f'"{" " * (len(match[0]) - 2)}"', text)
        code = re.split(r"[;\r\n]", quiet, maxsplit=1)[0]
        if code.strip() and not code.startswith("&"):
            found.append(Line(source, number, start, code))
        start += len(text)
    return found


def closing(line: Line, at: int) -> int:
    """Behind the brace that closes the one at a character."""
    depth = 0
    for end in range(at, len(line.code)):
        depth += (line.code[end] == "{") - (line.code[end] == "}")
        if depth == 0:
            return end + 1
    raise ProgramError(f"{line.where}: a brace is not closed")


def aggregate(line: Line, at: int) -> Value:
    """The aggregate that begins with the brace at a character."""
    end = closing(line, at) - 1
    inside = at + 1
    kind = re.match(r"\s*[A-Z]\w*\s*:", line.code[inside:end], re.IGNORECASE)
    inside += kind.end() if kind else 0
    value = Value(line, {}, {})
    for start, stop in parts(line.code, inside, end):
        _take(value, start, line.code[start:stop])
    return value


def parts(code: str, start: int, end: int) -> list[tuple[int, int]]:
    """Where the parts of a list stand that commas separate, outside of all brackets."""
    found, depth = [], 0
    for at in range(start, end):
        depth += (code[at] in "{[(") - (code[at] in "}])")
        if code[at] == "," and not depth:
            found.append((start, at))
            start = at + 1
    return [*found, (start, end)]


def _take(value: Value, at: int, part: str) -> None:
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
