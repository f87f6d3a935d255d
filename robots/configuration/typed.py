"""From nodes to a dataclass: checked entry by entry against types and declarations, then read by Drake."""

from collections.abc import Sequence
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydrake.common.yaml import yaml_dump, yaml_load_typed

from robots.configuration.nodes import Node
from robots.configuration.quantity import Declaration, declaration, dotted, out_of_range
from robots.configuration.suggestion import did_you_mean
from robots.configuration.union import entries, selected, tags, union_members

_Schema = TypeVar("_Schema")


def typed(node: Node, schema: type[_Schema], path: str = "") -> _Schema:
    """A dataclass with what a tree of nodes says; fields that it leaves out have their defaults.

    Args:
        node: the tree.
        schema: the dataclass.
        path: where the tree stands, for messages; empty for a whole file.

    Raises:
        ConfigurationError: if a key is unknown, a value of another kind, of another size or out of its range;
            one line that names place, path and what is allowed.
    """
    tree = _checked(node, schema, Declaration(), path)
    instance = yaml_load_typed(schema=schema, data=yaml_dump(tree))
    found = out_of_range(instance)
    if found:
        keys, reason = found
        raise node.at(keys).refuse(f"{dotted([path, *keys] if path else keys)} {reason}")
    return instance


def merged(base: Node, change: Node, schema: Any, path: str = "", merges_lists: bool = False) -> Node:
    """A tree with another one on top of it.

    Groups are merged key by key, everything else is replaced. Where a union changes its member, the new one
    keeps what the two have in common.

    Args:
        base: what was there.
        change: what comes on top.
        schema: the type of both.
        path: where they are, for messages.
        merges_lists: whether lists of groups of the same length are merged entry by entry.

    Raises:
        ConfigurationError: if a union has no such member.
    """
    members = union_members(schema)
    if members:
        return _merged_members(base, change, members, path, merges_lists)
    inner = _optional(schema)
    if isinstance(base.value, dict) and isinstance(change.value, dict):
        hints = _hints(inner)
        if hints is not None:
            result = dict(base.value)
            for key, node in change.value.items():
                below = f"{path}.{key}".lstrip(".")
                old = result.get(key)
                result[key] = node if old is None else merged(old, node, hints(key), below, merges_lists)
            return Node(result, change.place, change.tag or base.tag)
    if merges_lists and _are_alike(base, change):
        item = get_args(inner)[0] if get_origin(inner) is list else object
        pairs = enumerate(zip(base.value, change.value, strict=True))
        return Node([merged(*pair, item, f"{path}[{i}]", True) for i, pair in pairs], change.place)
    return change


def _are_alike(base: Node, change: Node) -> bool:
    """Whether two nodes are lists of as many groups."""
    lists = [each.value for each in (base, change) if isinstance(each.value, list)]
    return len(lists) == 2 and len(lists[0]) == len(lists[1]) and _are_groups([*lists[0], *lists[1]])


def _are_groups(nodes: Sequence[Node]) -> bool:
    return all(isinstance(node.value, dict) for node in nodes)


def _merged_members(
    base: Node, change: Node, members: tuple[type, ...], path: str, merges_lists: bool
) -> Node:
    before = selected(members, base, path) or members[0]
    member = selected(members, change, path) or before
    old, new = entries(base, members), entries(change, members)
    if old is None or new is None:
        return change
    known = {entry.name for entry in fields(member)}
    # What came with another member is put aside for when that one is chosen; what is wrong is refused later.
    lost = {entry.name for entry in fields(before)} - known
    aside = base.aside | {key: node for key, node in old.items() if key in lost}
    kept = {key: node for key, node in aside.items() if key in known}
    kept |= {key: node for key, node in old.items() if key not in lost}
    new = {key: node for key, node in change.aside.items() if key in known} | new
    aside = {key: node for key, node in (aside | change.aside).items() if key not in known}
    both = merged(Node(kept, base.place), Node(new, change.place), member, path, merges_lists)
    return Node(both.value, change.place, member.__name__, aside)


def _checked(node: Node, schema: Any, declared: Declaration, path: str) -> Any:
    """The plain tree of a node that fits, with texts such as 50e-6 made the numbers that are wanted."""
    members = union_members(schema)
    if members and not (node.value is None and NoneType in get_args(schema)):
        member = selected(members, node, path) or members[0]
        inside = entries(node, members)
        if inside is None:
            raise node.refuse(f"{path} must be a group of {_names(member)}, got {node.plain!r}")
        inside = _with_aside(node.aside, members, member, path) | inside
        tree = _checked_fields(Node(inside, node.place), member, path)
        return tree if member is members[0] else {"_tag": f"!{member.__name__}"} | tree
    if members or _optional(schema) is not schema:
        return None if node.value is None else _checked(node, _optional(schema), declared, path)
    own = tags(schema) if is_dataclass(schema) else ()
    if node.tag and node.tag not in own:
        allowed = f"no tag but !{own[-1]}" if own else "no tag"
        raise node.refuse(f"{path or 'the file'} takes {allowed}, got !{node.tag}")
    if is_dataclass(schema):
        return _checked_fields(node, schema, path)
    if get_origin(schema) is dict:
        return _checked_dict(node, get_args(schema)[1], declared, path)
    if schema is np.ndarray or get_origin(schema) is list:
        return _checked_list(node, schema, declared, path)
    return _checked_scalar(node, schema, declared, path)


def _with_aside(
    aside: dict[str, Node], members: tuple[type, ...], member: type, path: str
) -> dict[str, Node]:
    """What was put aside and a member knows. Raises ConfigurationError for what no member knows."""
    known = {each: [entry.name for entry in fields(each)] for each in members}
    for key, node in aside.items():
        if not any(key in names for names in known.values()):
            names = dict.fromkeys(name for each in members for name in known[each])
            raise node.refuse(
                f"unknown key '{path}.{key}'; known here: {', '.join(names)}{did_you_mean(key, names)}"
            )
    return {key: node for key, node in aside.items() if key in known[member]}


def _checked_fields(node: Node, schema: Any, path: str) -> dict[str, Any]:
    known: dict[str, Field] = {entry.name: entry for entry in fields(schema)}
    if not isinstance(node.value, dict):
        name = path or "the file"
        raise node.refuse(f"{name} must be a group of {', '.join(known)}, got {node.plain!r}")
    hints, tree = get_type_hints(schema), {}
    for key, entry in node.value.items():
        below = f"{path}.{key}".lstrip(".")
        if key not in known:
            guess = did_you_mean(key, known)
            raise entry.refuse(f"unknown key '{below}'; known here: {', '.join(known)}{guess}")
        tree[key] = _checked(entry, hints[key], _declared(known[key], hints[key]), below)
    return tree


def _declared(entry: Field, schema: Any) -> Declaration:
    """What a field declares; where it says no more, its default does.

    An array has as many numbers as its default, a mapping the same keys.
    """
    declared = declaration(entry)
    if entry.default_factory is MISSING:
        return declared
    if schema is np.ndarray and not declared.sizes:
        return replace(declared, sizes=_size(entry.default_factory()))
    if get_origin(schema) is dict and declared.choices is None:
        default = entry.default_factory()
        if default:
            sizes = _size(next(iter(default.values())))
            return replace(declared, choices=lambda: tuple(default), sizes=sizes)
    return declared


def _size(default: Any) -> tuple[int, ...]:
    """The size of an array of numbers in a row; empty for anything else."""
    is_row = isinstance(default, np.ndarray) and default.ndim == 1 and default.size
    return (default.size,) if is_row else ()


def _checked_dict(node: Node, schema: Any, declared: Declaration, path: str) -> dict[str, Any]:
    allowed = declared.choices() if declared.choices else None
    if not isinstance(node.value, dict):
        raise node.refuse(f"{path} must be a group of {', '.join(allowed or ['names'])}, got {node.plain!r}")
    for key, entry in node.value.items():
        if allowed is not None and key not in allowed:
            guess = did_you_mean(key, allowed)
            raise entry.refuse(f"unknown key '{path}.{key}'; known here: {', '.join(allowed)}{guess}")
    inner = Declaration(sizes=declared.sizes)
    return {key: _checked(entry, schema, inner, f"{path}.{key}") for key, entry in node.value.items()}


def _checked_list(node: Node, schema: Any, declared: Declaration, path: str) -> list[Any]:
    item = float if schema is np.ndarray else get_args(schema)[0]
    is_numbers = item in (float, int)
    value = node.value
    if is_numbers and _number(value) is not None and len(declared.sizes) != 1:
        value = [node]
    sizes = " or ".join(str(size) for size in declared.sizes if size)
    if not isinstance(value, list):
        wanted = f"{sizes} numbers" if is_numbers and sizes else "a list"
        raise node.refuse(f"{path} must be {wanted}, got {node.plain!r}")
    if schema is np.ndarray and not declared.sizes and any(isinstance(each.value, list) for each in value):
        item = list[float]  # a table
        rows = [len(each.value) if isinstance(each.value, list) else 0 for each in value]
        if len(set(rows)) > 1:
            wrong = value[next(i for i, size in enumerate(rows) if size != rows[0])]
            raise wrong.refuse(f"{path} must be rows of {rows[0]} numbers, got {wrong.plain!r}")
    if declared.sizes and len(value) not in declared.sizes:
        what = "numbers" if is_numbers else "entries"
        raise node.refuse(f"{path} must be {sizes} {what}, got {node.plain!r}")
    if is_numbers and item in (float, int) and any(_number(each.value) is None for each in value):
        wrong = next(each for each in value if _number(each.value) is None)
        hint = " with decimal points" if isinstance(wrong.value, str) and "," in wrong.value else ""
        wanted = f"{sizes} numbers".lstrip()
        raise wrong.refuse(f"{path} must be {wanted}{hint}, got {node.plain!r}")
    for i, each in enumerate(value):
        _require_choice(each, item, f"{path}[{i}]")
    return [_checked(each, item, Declaration(), f"{path}[{i}]") for i, each in enumerate(value)]


def _require_choice(node: Node, schema: Any, path: str) -> None:
    """Refuses an entry of a list that does not say of which kind it is: there no kind is the usual one."""
    members = union_members(schema)
    if members and selected(members, node, path) is None:
        names = ", ".join(f"!{member.__name__}" for member in members)
        raise node.refuse(f"{path} must begin with one of {names}, got {node.plain!r}")


def _checked_scalar(node: Node, schema: Any, declared: Declaration, path: str) -> Any:
    value = node.value
    if schema in (float, int):
        wanted = "a whole number" if schema is int else "a number"
        number = _number(value)
        if number is None or (schema is int and not float(number).is_integer()):
            raise node.refuse(f"{path} must be {wanted}, got {_shown(node)}")
        return int(number) if schema is int else float(number)
    if schema is bool:
        if not isinstance(value, bool):
            raise node.refuse(f"{path} must be true or false, got {_shown(node)}")
        return value
    if not isinstance(value, str):
        if value is None or isinstance(value, (bool, dict, list)):
            raise node.refuse(f"{path} must be a text, got {_shown(node)}")
        raise node.refuse(f"{path} must be a text, got {_shown(node)}: write it in quotes")
    allowed = declared.choices() if declared.choices else None
    if allowed is not None and value not in allowed:
        names = ", ".join(name for name in allowed if name)
        raise node.refuse(f"{path} must be one of {names}, got '{value}'{did_you_mean(value, allowed)}")
    return value


def _shown(node: Node) -> str:
    """A value as it was meant in YAML: true and not True."""
    if isinstance(node.value, bool):
        return str(node.value).lower()
    return "nothing" if node.value is None else repr(node.plain)


def _number(value: Any) -> float | int | None:
    """A number, also from a text: YAML takes 50e-6 for a text and wants 50.0e-6."""
    if isinstance(value, bool) or value is None or isinstance(value, (list, dict)):
        return None
    if isinstance(value, (int, float)):
        return value
    try:
        return float(value)
    except (TypeError, ValueError):
        return None


def _optional(schema: Any) -> Any:
    """The type inside ``T | None``; else the type itself."""
    if get_origin(schema) in (Union, UnionType):
        inner = [each for each in get_args(schema) if each is not NoneType]
        if len(inner) == 1:
            return inner[0]
    return schema


def _hints(schema: Any):
    """A function from a key to the type below it; None for what has no keys."""
    if is_dataclass(schema):
        hints = get_type_hints(schema)
        return lambda key: hints.get(key, object)
    if get_origin(schema) is dict:
        return lambda key: get_args(schema)[1]
    if schema is object:  # what a schema does not know, such as a law of one's own
        return lambda key: object
    return None


def _names(schema: Any) -> Sequence[str] | str:
    return ", ".join(entry.name for entry in fields(schema))
