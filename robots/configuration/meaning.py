"""What the fields of a dataclass mean: the comments that stand beside them in its source."""

import ast
import inspect
import io
import tokenize
from dataclasses import is_dataclass
from functools import cache


@cache
def meanings(schema: type) -> dict[str, str]:
    """The comment of each field, on its own lines or on those above it; fields without one are left out."""
    found: dict[str, str] = {}
    for base in reversed(schema.__mro__):
        if is_dataclass(base):
            found |= _own(base)
    return found


def _own(schema: type) -> dict[str, str]:
    try:
        source = inspect.cleandoc("\n" + inspect.getsource(schema))
    except (OSError, TypeError):  # a class that no file holds
        return {}
    body = ast.parse(source).body[0]
    assert isinstance(body, ast.ClassDef)
    lines = source.splitlines()
    comments = {
        token.start[0]: token.string.lstrip("# ").strip()
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    }
    found = {}
    for entry in body.body:
        if not (isinstance(entry, ast.AnnAssign) and isinstance(entry.target, ast.Name)):
            continue
        above, first = [], entry.lineno - 1
        while first in comments and lines[first - 1].lstrip().startswith("#"):
            above.insert(0, comments[first])
            first -= 1
        beside = [
            comments[n] for n in range(entry.lineno, (entry.end_lineno or entry.lineno) + 1) if n in comments
        ]
        if above or beside:
            found[entry.target.id] = " ".join([*above, *beside])
    return found
