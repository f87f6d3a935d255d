"""Members of a tagged union of dataclasses: `camera: !MarkerFeatures {...}` chooses one by its name."""

import re
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from robots.configuration.nodes import Node
from robots.configuration.suggestion import did_you_mean

_SELECTOR = "kind"  # a key in place of a tag, as --set station.camera.kind=features needs it


def union_members(schema: Any) -> tuple[type, ...]:
    """The classes of a union of dataclasses, the one that is meant without a tag first; else none."""
    if get_origin(schema) not in (Union, UnionType):
        return ()
    members = tuple(member for member in get_args(schema) if member is not NoneType)
    return members if len(members) > 1 and all(is_dataclass(member) for member in members) else ()


def short_name(member: type) -> str:
    """The name of a member in settings and on the command line: its ``kind``, or its class in snake case."""
    name = member.__name__.removesuffix("Config")
    return str(getattr(member, _SELECTOR, "")) or re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def tags(member: Any) -> tuple[str, str]:
    """How a tag may name a class: with and without ``Config`` at its end."""
    return member.__name__, member.__name__.removesuffix("Config")


def selected(members: tuple[type, ...], node: Node, path: str) -> type | None:
    """The member that a node selects by tag, short name or ``kind``; None if it leaves that open.

    Raises:
        ConfigurationError: if there is no such member.
    """
    name, where = node.tag or None, node
    if isinstance(node.value, str):
        name = node.value
    elif name is None and isinstance(node.value, dict) and _is_selector(node.value.get(_SELECTOR), members):
        where = node.value[_SELECTOR]
        name = where.value
    if name is None:
        return None
    for member in members:
        if name in (short_name(member), *tags(member)):
            return member
    names = [short_name(member) for member in members]
    guess = did_you_mean(name, [tags(member)[1] for member in members] if node.tag else names)
    raise where.refuse(f"{path} must be one of {', '.join(names)}, got '{name}'{guess}")


def entries(node: Node, members: tuple[type, ...]) -> dict[str, Node] | None:
    """The fields that a node sets of the member; None if it is neither a group nor a name."""
    if isinstance(node.value, str):
        return {}
    if not isinstance(node.value, dict):
        return None
    if _is_selector(node.value.get(_SELECTOR), members):
        return {key: each for key, each in node.value.items() if key != _SELECTOR}
    return node.value


def _is_selector(node: Node | None, members: tuple[type, ...]) -> bool:
    """Whether a ``kind`` chooses a member; a member may have a field of that name instead."""
    has_field = any(entry.name == _SELECTOR for member in members for entry in fields(member))
    return node is not None and isinstance(node.value, str) and not has_field
