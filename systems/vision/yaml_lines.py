"""In which line of a YAML file something stands, so that a refusal can name it."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
import yaml


def line_of(path: Path, place: Sequence[str | int]) -> int:
    """The line, from one, of a value: names of fields and numbers in lists lead to it from the outside.

    If the file leaves a field out, it is the line of what should have it.
    """
    node = yaml.compose(path.read_text(encoding="utf-8"))
    for key in place:
        inner = _inside(node, key)
        if inner is None:
            break
        node = inner
    return node.start_mark.line + 1


def first_misfit(path: Path, schema: type) -> tuple[int, str] | None:
    """Line and reason of the first entry that a dataclass tree cannot take.

    None if what is wrong is something else, or the file is not YAML at all.
    """
    try:
        node = yaml.compose(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError):
        return None
    return _misfit(node, schema, path.name)


def _inside(node: yaml.Node, key: str | int) -> yaml.Node | None:
    if isinstance(node, yaml.MappingNode):
        return next((value for name, value in node.value if name.value == key), None)
    if isinstance(node, yaml.SequenceNode) and isinstance(key, int) and key < len(node.value):
        return node.value[key]
    return None


def _misfit(node: yaml.Node, schema: Any, name: str) -> tuple[int, str] | None:
    """The first misfit in a node, whose own name is given."""
    line = node.start_mark.line + 1
    if is_dataclass(schema):
        if not isinstance(node, yaml.MappingNode):
            return line, f"{name} must have the fields {', '.join(field.name for field in fields(schema))}"
        hints = get_type_hints(schema)
        known = [field.name for field in fields(schema)]
        for key, value in node.value:
            if key.value not in known:
                where = key.start_mark.line + 1
                return where, f"{name} has no field '{key.value}', only {', '.join(known)}"
            found = _misfit(value, hints[key.value], key.value)
            if found:
                return found
        return None
    if get_origin(schema) is list:
        if not isinstance(node, yaml.SequenceNode):
            return line, f"{name} must be a list"
        (item,) = get_args(schema)
        return next(filter(None, (_misfit(each, item, name) for each in node.value)), None)
    return _not_a_number(node, name) if schema in (float, int, np.ndarray) else None


def _not_a_number(node: yaml.Node, name: str) -> tuple[int, str] | None:
    if isinstance(node, yaml.SequenceNode):
        return next(filter(None, (_not_a_number(each, name) for each in node.value)), None)
    try:
        float(node.value.replace(".inf", "inf").replace(".nan", "nan"))
    except (AttributeError, ValueError):
        text = "a mapping" if isinstance(node, yaml.MappingNode) else f"'{node.value}'"
        return node.start_mark.line + 1, f"{name} must be numbers with decimal points, got {text}"
    return None
