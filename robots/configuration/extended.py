"""Files that extend others: what a file says on top of what another one says."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robots.configuration.nodes import ConfigurationError, Node, read_nodes
from robots.configuration.typed import merged

_DEEPEST = 8  # files that extend one another


@dataclass(frozen=True)
class FileKind:
    """One kind of configuration file.

    Attributes:
        schema: the dataclass that it holds.
        find: gives path and label of a file by the name that stands after ``extends`` and the folder of the
            file that says so.
        merges_lists: whether lists of groups of the same length are merged entry by entry, else replaced.
        renamed: puts what a file says under former names in its present place.
        read: gives the nodes of a file by its path and label.
    """

    schema: Any
    find: Callable[[str, Path], tuple[Path, str]]
    merges_lists: bool = False
    renamed: Callable[[Node], Node] = lambda node: node
    read: Callable[[Path, str], Node] = read_nodes


def read_extended(name: str, kind: FileKind) -> Node:
    """The nodes of a file on top of those of the file that it names after ``extends``, if it does.

    Raises:
        ConfigurationError: if a file is missing or no mapping, or files extend each other in a circle.
    """
    return _read(*kind.find(name, Path()), kind, 0)


def _read(path: Path, label: str, kind: FileKind, depth: int) -> Node:
    if depth > _DEEPEST:
        raise ConfigurationError(f"{label}: 'extends' runs in a circle")
    node = kind.read(path, label)
    if not isinstance(node.value, dict):
        raise ConfigurationError(f"{label}: must be a mapping of keys to values")
    own = Node({key: entry for key, entry in node.value.items() if key != "extends"}, node.place)
    own = kind.renamed(own)
    base = _base(node)
    if base is None:
        return own
    try:
        found = kind.find(base.value, path.parent)
    except ConfigurationError as error:
        raise base.refuse(f"extends: {error}") from error
    below = _read(*found, kind, depth + 1)
    return merged(below, own, kind.schema, merges_lists=kind.merges_lists)


def _base(node: Node) -> Node | None:
    """What stands after ``extends``; None if nothing does. Raises ConfigurationError if it is no name."""
    base = node.value.get("extends") if isinstance(node.value, dict) else None
    if base is None or base.value in (None, ""):
        return None
    if not isinstance(base.value, str):
        raise base.refuse(f"extends must be the name of one file, got {base.plain!r}")
    return base


def extends(name: str, kind: FileKind) -> str | None:
    """What a file names after ``extends``, as others can name it, too; None if it stands alone.

    Raises:
        ConfigurationError: if there is no such file, or it cannot be read.
    """
    path, label = kind.find(name, Path())
    base = _base(kind.read(path, label))
    if base is None:
        return None
    beside = path.parent / base.value
    return str(beside if beside.is_file() else base.value)
