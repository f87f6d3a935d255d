"""Cells and bodies as YAML files: where the shipped ones are, and one-line errors for the others."""

from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TypeVar

from pydrake.common.yaml import yaml_load_typed

from systems.vision.yaml_lines import first_misfit, line_of

Problem = tuple[Sequence[str | int], str]  # a place in a file, and what is wrong there

_Schema = TypeVar("_Schema")


def load_data_file(
    name: str, kind: str, schema: type[_Schema], problem_of: Callable[[_Schema], Problem | None]
) -> _Schema:
    """Reads a cell or a body and refuses one that cannot be.

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
    data = _read(path, schema)
    problem = problem_of(data)
    if problem:
        place, reason = problem
        raise ValueError(f"{kind} file {path}, line {line_of(path, place)}: {reason}")
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
    path = Path(name) if name.endswith((".yaml", ".yml")) else Path(str(folder / f"{name}_{kind}.yaml"))
    if not path.is_file():
        ending = f"_{kind}.yaml"
        shipped = sorted(
            entry.name.removesuffix(ending) for entry in folder.iterdir() if entry.name.endswith(ending)
        )
        raise ValueError(
            f"{kind} '{name}': no file {path}; give the path of a YAML file or one of {', '.join(shipped)}"
        )
    return path


def _read(path: Path, schema: type[_Schema]) -> _Schema:
    """Reads a dataclass tree from a YAML file.

    Raises:
        ValueError: if the file is not YAML or does not fit the schema; one line that names file and line.
    """
    try:
        return yaml_load_typed(schema=schema, filename=str(path))
    except Exception as error:  # the parser raises a dozen types, all of them about this file
        misfit = first_misfit(path, schema)
        if misfit:
            line, reason = misfit
            raise ValueError(f"file {path}, line {line}: {reason}") from error
        raise ValueError(f"file {path}: {' '.join(str(error).split())}") from error
