"""YAML as nodes that know where they stand, so that a refusal can name file and line."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

YAML = (".yaml", ".yml")  # how names of files end that are read as such, in letters of either size

# Octal numbers such as 010, and 1:30, which is 90; 0o10, 0x8 and 0b1000 are meant.
_SURPRISING = re.compile(r"[-+]?(0[0-7_]+|\d[\d_]*(:\d+)+(\.\d*)?)")


class ConfigurationError(ValueError):
    """Something written cannot be used; the message says where it stands, what it is and what is allowed."""


@dataclass(frozen=True)
class Node:
    """A value, or nodes by their keys or in their order, with the place where it was written."""

    value: Any  # dict[str, Node], list[Node] or a plain value
    place: str  # such as "scenario mine.yaml, line 3"
    tag: str = ""  # without the "!", of a member of a union
    aside: dict[str, "Node"] = field(default_factory=dict)  # fields that other members of the union have

    @property
    def plain(self) -> Any:
        """The value without places."""
        if isinstance(self.value, dict):
            tag = {"_tag": f"!{self.tag}"} if self.tag else {}
            return tag | {key: node.plain for key, node in self.value.items()}
        return [node.plain for node in self.value] if isinstance(self.value, list) else self.value

    def at(self, keys: Sequence[str | int]) -> "Node":
        """The node that names and list indices lead to; the last one on the way if there is no more."""
        node = self
        for key in keys:
            inside = node.value
            if isinstance(inside, dict) and key in inside:
                node = inside[str(key)]
            elif isinstance(inside, list) and isinstance(key, int) and key < len(inside):
                node = inside[key]
            else:
                break
        return node

    def check_count(self, key: str, count: int) -> None:
        """Raises ConfigurationError if under a key there is nothing, or a list of another length."""
        entries = self.value.get(key, Node([], self.place)) if isinstance(self.value, dict) else self
        if isinstance(entries.value, list) and len(entries.value) != count:
            raise entries.refuse(
                f"{key} must have {count} entries, got {len(entries.value)}; {{}} stands for one that is as "
                "in the file that is extended"
            )

    def refuse(self, reason: str) -> ConfigurationError:
        """The error that says what is wrong with this node."""
        return ConfigurationError(f"{self.place}: {reason}")


def read_nodes(path: Path, label: str) -> Node:
    """Reads a YAML file.

    Args:
        path: which one.
        label: how messages call it, such as ``"robot file kr16.yaml"``.

    Raises:
        ConfigurationError: if it is not YAML, holds more than one document or names a key twice.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"{label}: {(error.strerror or _one_line(error)).lower()}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{label}: not a text file in UTF-8") from error
    return parse(text, label)


@lru_cache(maxsize=64)  # robots are loaded again and again; nodes are never changed
def parse(text: str, label: str, has_lines: bool = True) -> Node:
    """The nodes of a YAML text; see `read_nodes`."""
    loader = _loader(text)
    try:
        root = loader.get_single_node()
        if root is None:
            return Node(None, label)
        return _node(loader, root, label, has_lines)
    except (yaml.YAMLError, ValueError) as error:
        if isinstance(error, ConfigurationError):
            raise
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark and has_lines else ""
        problem = getattr(error, "problem", None) or error
        raise ConfigurationError(f"{label}{line}: no valid YAML: {_one_line(problem)}") from error
    finally:
        loader.dispose()


def _loader(text: str) -> Any:
    """The parser in C, ten times faster, unless something is wrong: the one in Python says better what."""
    fast = getattr(yaml, "CSafeLoader", None)
    if fast is None:
        return yaml.SafeLoader(text)
    try:
        for _ in yaml.parse(text, Loader=fast):
            pass
    except yaml.YAMLError:
        return yaml.SafeLoader(text)
    return fast(text)


def _node(loader: Any, node: yaml.Node, label: str, has_lines: bool) -> Node:
    place = f"{label}, line {node.start_mark.line + 1}" if has_lines else label
    own_tag = node.tag.removeprefix("!") if node.tag.startswith("!") else ""
    if isinstance(node, yaml.MappingNode):
        entries: dict[str, Node] = {}
        for key, value in node.value:
            where = f"{label}, line {key.start_mark.line + 1}" if has_lines else label
            if not isinstance(key, yaml.ScalarNode):
                raise ConfigurationError(f"{where}: a key must be a name")
            if key.value in entries:
                raise ConfigurationError(f"{where}: key '{key.value}' is given twice")
            entries[key.value] = _node(loader, value, label, has_lines)
        return Node(entries, place, own_tag)
    if isinstance(node, yaml.SequenceNode):
        return Node([_node(loader, each, label, has_lines) for each in node.value], place, own_tag)
    if own_tag:
        if node.value:
            raise ConfigurationError(f"{place}: !{own_tag} must be followed by a group, got '{node.value}'")
        return Node({}, place, own_tag)
    value = loader.construct_object(node)
    decimal = node.value.lstrip("+-0").replace("_", "") or "0"
    if isinstance(value, int | float) and _SURPRISING.fullmatch(node.value) and decimal != f"{abs(value)}":
        raise ConfigurationError(
            f"{place}: {node.value} would be {value:g}, for YAML reads it with base 8 or 60; "
            "write a decimal number"
        )
    return Node(value, place)


def _one_line(error: object) -> str:
    return " ".join(str(error).split())
