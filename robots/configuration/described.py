"""The fields of a configuration as rows of a table: place, default, and what is allowed."""

from collections.abc import Iterator
from dataclasses import Field, dataclass, fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from robots.configuration.quantity import declaration
from robots.configuration.union import short_name, union_members

_LONGEST = 40  # characters of a default


@dataclass(frozen=True)
class Described:
    """One field."""

    path: str
    default: str
    allowed: str  # range and unit, names to choose from, or the kind of value


def described(example: Any, path: str = "") -> Iterator[Described]:
    """All fields of a dataclass tree, whose values are the defaults; members of a union have their tags."""
    hints = get_type_hints(type(example))
    for entry in fields(example):
        below, value = f"{path}.{entry.name}".lstrip("."), getattr(example, entry.name)
        members = union_members(hints[entry.name])
        if members and value is not None:
            names = ", ".join(short_name(member) for member in members)
            yield Described(below, short_name(type(value)), names)
            for member in members:
                tag = f"{below}(!{member.__name__.removesuffix('Config')})"
                yield from described(value if isinstance(value, member) else member(), tag)
        elif is_dataclass(value):
            yield from described(value, below)
        else:
            yield Described(below, _text(value), _allowed(entry, hints[entry.name]))


def _text(value: Any) -> str:
    """A default, empty for none and for one that is too long."""
    if value is None:
        return ""
    if isinstance(value, np.ndarray):
        return str([float(f"{number:g}") for number in value.tolist()]) if value.ndim == 1 else ""
    if isinstance(value, float):
        return f"{value:g}"
    return str(value) if len(str(value)) < _LONGEST else ""


def _allowed(entry: Field, hint: Any) -> str:
    declared = declaration(entry)
    if declared.choices is not None:
        return ", ".join(name for name in declared.choices() if name)
    limits = str(declared.limits)
    if limits != "finite":
        return limits
    if get_origin(hint) in (Union, UnionType):
        hint = next(each for each in get_args(hint) if each is not NoneType)
    names = {bool: "true or false", str: "text", int: "whole number", float: "number", np.ndarray: "numbers"}
    return names.get(hint, "list" if get_origin(hint) is list else "group")
