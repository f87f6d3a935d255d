"""The text of ABB RAPID: tokens, statements, and aggregates such as ``[[600, 0, 800], [1, 0, 0, 0]]``."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from robots.programs.program import Literal, Source

_TOKEN = re.compile(
    r"(?P<comment>![^\r\n]*)"
    r'|(?P<string>"(?:[^"\r\n]|"")*")'
    r"|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[^\W\d]\w*)"
    r"|(?P<sign>:=|<>|<=|>=|\S)"
)
_OPENING, _CLOSING = "([{", ")]}"
_WORDS = """
alias and backward case connect const default div do else elseif endfor endfunc endif endmodule
endproc endrecord endtest endtrap endwhile error exit for from func goto if inout local mod module
nostepin not noview or pers proc raise readonly record retry return step sysmodule task test then to
trap true false trynext undo var viewonly while with xor
"""
KEYWORDS = frozenset(_WORDS.split())


@dataclass(frozen=True)
class Token:
    """A word, number, string or sign."""

    kind: str
    text: str
    start: int
    end: int

    @property
    def word(self) -> str:
        """In small letters: RAPID does not tell capitals from others."""
        return self.text.lower()


@dataclass(frozen=True)
class Other:
    """What is neither a number nor an aggregate: a name, a string, an expression."""

    text: str


Tree = Literal | Other | list["Tree"]


def statements(source: Source) -> Iterator[list[Token]]:
    """The tokens of each statement, without its semicolon; comments are skipped."""
    statement: list[Token] = []
    for match in _TOKEN.finditer(source.text):
        kind = str(match.lastgroup)
        if kind == "comment":
            continue
        if match.group() == ";":
            yield statement
            statement = []
        else:
            statement.append(Token(kind, match.group(), match.start(), match.end()))
    yield statement


def without_heading(statement: Sequence[Token]) -> Sequence[Token]:
    """What follows the name and the parameters of a routine, where the statement begins with one."""
    for at, token in enumerate(statement):
        if token.word in ("proc", "func", "trap", "module"):
            depth = 0
            for end in range(at + 1, len(statement)):
                depth += (statement[end].text == "(") - (statement[end].text == ")")
                following = statement[end + 1].text if end + 1 < len(statement) else ""
                if depth == 0 and following != "(" and (statement[end].text == ")" or token.word != "func"):
                    return without_heading(statement[end + 1 :])
    return statement


def without_short_condition(statement: Sequence[Token]) -> Sequence[Token]:
    """What is done under an IF without THEN: it begins with the first name that follows upon an operand."""
    words = [token.word if token.kind == "name" else "" for token in statement]
    begin = len(words) - words[::-1].index("if") if "if" in words else len(words)
    if "then" in words[begin:]:
        return statement
    for at in range(begin + 1, len(words)):
        before = statement[at - 1]
        is_operand = before.kind in ("number", "string") or before.text in (")", "]", "}")
        is_operand = is_operand or (before.kind == "name" and before.word not in KEYWORDS - {"true", "false"})
        if is_operand and words[at] and words[at] not in KEYWORDS:
            return statement[at:]
    return statement


def assigned(statement: Sequence[Token]) -> Token | None:
    """The name of what a statement without heading and condition gives a value, or to a part of it."""
    for at, (token, after) in enumerate(pairwise(statement)):
        if token.kind == "name" and token.word not in KEYWORDS:
            is_one = after.text in (":=", ".", "{") and len(split(statement[at:], ":=")) == 2
            if is_one or is_argument(after):
                return token if is_one else None
    return None


def is_argument(token: Token) -> bool:
    """Whether the name before a token is that of an instruction, of which the arguments begin with it."""
    return token.word not in KEYWORDS and (token.text in ("[", "\\") or token.kind != "sign")


def aggregate(tokens: Sequence[Token]) -> Tree:
    """The value that all of some tokens write."""
    tree, end = _value(tokens, 0)
    return tree if end == len(tokens) else Other(_text(tokens))


def literals(tree: Tree, *lengths: int) -> list[list[Literal]] | None:
    """The numbers of an aggregate of aggregates of these lengths; None if it is anything else."""
    if not has_shape(tree, *lengths):
        return None
    assert isinstance(tree, list)
    rows = []
    for part in tree:
        assert isinstance(part, list)
        row = [each for each in part if isinstance(each, Literal)]
        if len(row) < len(part):
            return None
        rows.append(row)
    return rows


def why_unread(tree: Tree) -> str:
    """What keeps an aggregate from being a target in numbers, as words behind its name."""
    parts: list[Tree] = [tree]
    texts = []
    while parts:
        part = parts.pop()
        if isinstance(part, list):
            parts += part
        elif isinstance(part, Other):
            texts.append(part.text)
    if "" in texts:
        return "lacks a number"
    if texts:
        return "has expressions in place of numbers"
    return f"has {'a quaternion of zero' if has_shape(tree, 3, 4, 4, 6) else 'too few or too many numbers'}"


def has_shape(tree: Tree, *lengths: int) -> bool:
    """Whether it is an aggregate of aggregates of these lengths, whatever these hold."""
    if not isinstance(tree, list) or len(tree) != len(lengths):
        return False
    return all(
        isinstance(part, list) and len(part) == length and not any(isinstance(each, list) for each in part)
        for part, length in zip(tree, lengths, strict=True)
    )


def split(tokens: Sequence[Token], *signs: str) -> list[tuple[str, list[Token]]]:
    """Parts of a list, each with the sign before it (empty for the first), outside of all brackets."""
    parts: list[tuple[str, list[Token]]] = [("", [])]
    depth = 0
    for token in tokens:
        depth += (token.text in _OPENING) - (token.text in _CLOSING) if token.kind == "sign" else 0
        if depth == 0 and token.kind == "sign" and token.text in signs:
            parts.append((token.text, []))
        else:
            parts[-1][1].append(token)
    return parts


def _value(tokens: Sequence[Token], at: int) -> tuple[Tree, int]:
    """The value that begins at a token, and where it ends."""
    if at < len(tokens) and tokens[at].text == "[":
        parts: list[Tree] = []
        while at < len(tokens) and tokens[at].text != "]":
            part, at = _value(tokens, at + 1)
            parts.append(part)
        return parts, at + 1
    start, depth = at, 0
    while at < len(tokens):
        text = tokens[at].text if tokens[at].kind == "sign" else ""
        if depth == 0 and text in (",", "]"):
            break
        depth += (text != "" and text in _OPENING) - (text != "" and text in _CLOSING)
        at += 1
    return _single(tokens[start:at]), at


def _single(tokens: Sequence[Token]) -> Tree:
    numbers = [token for token in tokens if token.kind == "number"]
    has_sign = len(tokens) == 2 and tokens[0].text in "+-"
    if len(numbers) == 1 and (len(tokens) == 1 or (has_sign and tokens[1] is numbers[0])):
        value = float(numbers[0].text) * (-1.0 if tokens[0].text == "-" else 1.0)
        return Literal(tokens[0].start, tokens[-1].end, value)
    return Other(_text(tokens))


def _text(tokens: Sequence[Token]) -> str:
    return " ".join(token.text for token in tokens)
