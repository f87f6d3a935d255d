"""Files that extend others: what a file says on top of what another one says."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydrake.common.yaml import yaml_dump, yaml_load

_DEEPEST = 8  # files that extend one another


def whole_text(path: Path, find: Callable[[str, Path], Path], depth: int = 0) -> str:
    """The text of a YAML file, on top of the one that it names after ``extends`` if it does.

    Groups are merged key by key, lists of groups entry by entry; everything else is replaced.

    Args:
        path: of the file.
        find: gives the path of a file by its name and the folder in which a relative one stands.
        depth: how many files extend this one.

    Raises:
        ValueError: if the other one is missing, or files extend each other in a circle.
    """
    text = path.read_text(encoding="utf-8")
    if not re.search(r"^extends:", text, re.MULTILINE):
        return text
    if depth > _DEEPEST:
        raise ValueError("'extends' runs in a circle")
    change = yaml_load(data=text)
    base = find(str(change.pop("extends")), path.parent)
    return str(yaml_dump(_overlaid(yaml_load(data=whole_text(base, find, depth + 1)), change)))


def _overlaid(base: Any, change: Any) -> Any:
    if isinstance(base, dict) and isinstance(change, dict):
        return base | {key: _overlaid(base.get(key), value) for key, value in change.items()}
    are_lists = isinstance(base, list) and isinstance(change, list) and len(base) == len(change)
    if are_lists and all(isinstance(item, dict) for item in [*base, *change]):
        return [_overlaid(*pair) for pair in zip(base, change, strict=True)]
    return change
