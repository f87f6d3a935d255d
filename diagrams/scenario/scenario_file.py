"""Reading a configuration tree: YAML files that extend one another, changes on top, a check of its shape."""

import math
from dataclasses import fields, is_dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_load

_DEEPEST = 8  # files that extend one another


class ScenarioError(ValueError):
    """A scenario is missing, cannot be read, or asks for something impossible."""


def shipped_scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    names = (entry.name for entry in _folder().iterdir())
    return sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml"))


def read_tree(name: str, settings: list[str]) -> dict:
    """The tree of a scenario, with what it extends, and the settings applied.

    Args:
        name: a shipped scenario or the path of a YAML file.
        settings: changes such as ``"station.camera.delay=0.008"``; the value is read as YAML.

    Raises:
        ScenarioError: if a file or a setting cannot be read.
    """
    tree = _read(name, Path(), 0)
    for setting in settings:
        _apply(tree, setting)
    return tree


def conformed(value: Any, default: Any, where: str = "") -> Any:
    """A tree in the shape of a default, with texts such as 50e-6 made the numbers that are wanted.

    Args:
        value: what was read.
        default: a dataclass, mapping, array, list or plain value that says what is wanted.
        where: the path of the value, for messages.

    Raises:
        ScenarioError: if a key is unknown or a value is of another kind; the message names its path.
    """
    if is_dataclass(default) or isinstance(default, dict):
        known = (
            default
            if isinstance(default, dict)
            else {f.name: getattr(default, f.name) for f in fields(default)}
        )
        if not isinstance(value, dict):
            raise ScenarioError(f"{where} must be a group of {', '.join(known)}, got {value!r}")
        prefix = f"{where}." if where else ""
        for key in value:
            if key not in known:
                raise ScenarioError(f"unknown key '{prefix}{key}'; known here: {', '.join(known)}")
        return {key: conformed(entry, known[key], f"{prefix}{key}") for key, entry in value.items()}
    if isinstance(default, np.ndarray):
        numbers = [_number(entry) for entry in value] if isinstance(value, list) else []
        if len(numbers) != default.size or None in numbers:
            raise ScenarioError(f"{where} must be {default.size} numbers, got {value!r}")
        return numbers
    if isinstance(default, list):
        if not isinstance(value, list):
            raise ScenarioError(f"{where} must be a list, got {value!r}")
        return (
            [conformed(entry, default[0], f"{where}[{i}]") for i, entry in enumerate(value)]
            if default
            else value
        )
    if isinstance(default, int):
        if not isinstance(value, int):
            raise ScenarioError(f"{where} must be a whole number, got {value!r}")
        return value
    if isinstance(default, float) or (default is None and value is not None):
        number = _number(value)
        if number is None:
            raise ScenarioError(f"{where} must be a number, got {value!r}")
        return number
    return value


def one_line(error: Exception) -> str:
    """The message of an error without line breaks."""
    return " ".join(str(error).split())


def _folder():
    return files("diagrams.scenario") / "data"


def _read(name: str, beside: Path, depth: int) -> dict:
    is_file = name.endswith((".yaml", ".yml"))
    path = beside / name if is_file else Path(str(_folder() / f"{name}.yaml"))
    if not path.is_file():
        allowed = ", ".join(shipped_scenarios())
        raise ScenarioError(
            f"scenario '{name}': no file {path}; give the path of a YAML file or one of {allowed}"
        )
    if depth > _DEEPEST:
        raise ScenarioError(f"scenario {path}: 'extends' runs in a circle")
    try:
        tree = yaml_load(filename=str(path))
    except Exception as error:  # the parser raises a dozen types, all of them about this file
        raise ScenarioError(f"scenario {path}: {one_line(error)}") from error
    if not isinstance(tree, dict):
        raise ScenarioError(f"scenario {path}: must be a mapping of keys to values")
    base = tree.pop("extends", None)
    return _merged(_read(str(base), path.parent, depth + 1), tree) if base else tree


def _merged(base: dict, change: dict) -> dict:
    result = dict(base)
    for key, value in change.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = _merged(result[key], value) if both else value
    return result


def _apply(tree: dict, setting: str) -> None:
    key, separator, value = setting.partition("=")
    if not separator or not key:
        raise ScenarioError(f"--set {setting}: must look like station.camera.delay=0.008")
    parts = key.strip().split(".")
    for part in parts[:-1]:
        tree = tree.setdefault(part, {})
        if not isinstance(tree, dict):
            raise ScenarioError(f"--set {setting}: '{part}' is a value, not a group")
    try:
        tree[parts[-1]] = yaml_load(data=f"value: {value}")["value"]
    except Exception as error:  # the parser again
        raise ScenarioError(f"--set {setting}: {one_line(error)}") from error


def _number(value: Any) -> float | None:
    """A finite number, also from a text: YAML takes 50e-6 for a text and wants 50.0e-6."""
    if isinstance(value, bool):
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if math.isfinite(number) else None
