"""Reading cells and bodies from YAML files, shipped or one's own; errors are one line."""

from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TypeVar

from robots.configuration.nodes import YAML, read_nodes
from robots.configuration.suggestion import why_no_file
from robots.configuration.typed import typed

Problem = tuple[Sequence[str | int], str]  # a place in a file, and what is wrong there

_Schema = TypeVar("_Schema")


def load_data_file(
    name: str, kind: str, schema: type[_Schema], problem_of: Callable[[_Schema], Problem | None]
) -> _Schema:
    """Reads and checks a cell or a body.

    Args:
        name: as for `data_file`.
        kind: ``"cell"`` or ``"body"``.
        schema: the dataclass tree that the file holds.
        problem_of: gives the first thing that is wrong with it, or None.

    Raises:
        ValueError: if there is no such file, or it does not describe what it should; one line that names file
            and line.
    """
    path = data_file(name, kind)
    node = read_nodes(path, f"{kind} file {path}")
    data = typed(node, schema)
    problem = problem_of(data)
    if problem:
        keys, reason = problem
        raise node.at(keys).refuse(reason)
    return data


def data_file(name: str, kind: str) -> Path:
    """The file of a shipped cell or body by name (``"probst"``), or the path that is given.

    Args:
        name: a name, or a path that ends in .yaml or .yml.
        kind: ``"cell"`` or ``"body"``.

    Raises:
        ValueError: if there is no such file.
    """
    folder = files("systems.vision") / "data"
    is_file = name.lower().endswith(YAML)
    path = Path(name) if is_file else Path(str(folder / f"{name}_{kind}.yaml"))
    if not path.is_file():
        ending = f"_{kind}.yaml"
        shipped = sorted(
            entry.name.removesuffix(ending) for entry in folder.iterdir() if entry.name.endswith(ending)
        )
        missing = why_no_file(Path(name), is_file, *YAML)
        raise ValueError(
            f"{kind} '{name}': {missing}; give the path of a YAML file or one of {', '.join(shipped)}"
        )
    return path
