"""What the pages say beside their figures."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import experiments

TABLES = ("html_table", "sortable_table", "_point_table")


def sections() -> Iterator[tuple[str, list[ast.expr]]]:
    """The place and the arguments of every section of every page, as they are written."""
    for file in sorted(Path(experiments.__path__[0]).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Section":
                yield f"{file.name}:{node.lineno}", node.args


def is_written(content: ast.expr) -> bool:
    """Whether it is a table or text, which speaks for itself."""
    if isinstance(content, ast.Call) and isinstance(content.func, ast.Name):
        return content.func.id in TABLES
    return isinstance(content, ast.JoinedStr)


@pytest.mark.slow
def test_every_figure_says_what_one_should_see():
    silent = [
        place
        for place, (_, note, content, *_) in sections()
        if isinstance(note, ast.Constant) and not note.value and not is_written(content)
    ]
    assert silent == []
