"""The fields of a configuration as rows of a table: place, default, what is allowed, what it means."""

from collections.abc import Iterator
from dataclasses import Field, dataclass, fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from robots.configuration.meaning import meanings
from robots.configuration.quantity import declaration
from robots.configuration.union import short_name, union_members

_LONGEST = 40  # characters of a default


@dataclass(frozen=True)
class Described:
    """One field."""

    path: str
    default: str
    allowed: str  # range and unit, names to choose from, or the kind of value
    meaning: str = ""  # the comment beside it


def described(example: Any, path: str = "") -> Iterator[Described]:
    """All fields of a dataclass tree, whose values are the defaults; members of a union have their tags.

    What stands in a list, or is left out unless it is wanted, follows with the defaults of its kind: as
    ``joints[]`` and ``links[].beam``.
    """
    hints, said = get_type_hints(type(example)), meanings(type(example))
    for entry in fields(example):
        below, value = f"{path}.{entry.name}".lstrip("."), getattr(example, entry.name)
        inner, is_list = _inner(hints[entry.name])
        members = _groups(inner)
        meaning = said.get(entry.name, "")
        if len(members) > 1:
            names = ", ".join(short_name(member) for member in members)
            default = "" if is_list or value is None else short_name(type(value))
            yield Described(below, default, f"list of {names}" if is_list else names, meaning)
        elif members and (is_list or value is None):
            yield Described(below, "", "list of groups" if is_list else "group, or left out", meaning)
        elif not members:
            yield Described(below, _text(value), _allowed(entry, hints[entry.name]), meaning)
        for member in members:
            inside = value if isinstance(value, member) else member()
            tag = f"(!{member.__name__.removesuffix('Config')})" if len(members) > 1 else ""
            yield from described(inside, f"{below}{'[]' if is_list else ''}{tag}")


def _groups(kind: Any) -> tuple[type, ...]:
    """The dataclasses of which a field holds one, none if it holds something else."""
    return union_members(kind) or ((kind,) if isinstance(kind, type) and is_dataclass(kind) else ())


def _inner(hint: Any) -> tuple[Any, bool]:
    """What stands in a field, or in each entry of its list; and whether it is a list."""
    if get_origin(hint) is list:
        return get_args(hint)[0], True
    if get_origin(hint) in (Union, UnionType) and not union_members(hint):
        return next(each for each in get_args(hint) if each is not NoneType), False
    return hint, False


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
        return f"group, each {limits}" if get_origin(hint) is dict else limits
    if get_origin(hint) in (Union, UnionType):
        hint = next(each for each in get_args(hint) if each is not NoneType)
    names = {bool: "true or false", str: "text", int: "whole number", float: "number", np.ndarray: "numbers"}
    return names.get(hint, "list" if get_origin(hint) is list else "group")
