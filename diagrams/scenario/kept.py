"""A scenario as it is kept beside results: it names the same files wherever it is read."""

from collections.abc import Iterable
from contextlib import suppress
from copy import deepcopy
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from diagrams.scenario.scenario import Scenario, scenario_text
from robots.configuration.nodes import YAML, ConfigurationError, read_nodes
from robots.configuration.quantity import declaration

_CLASS = ".py:"  # before the name of a class in a file
_LONGEST = 250  # bytes of a name of a file; longer ones are refused by systems


def kept_text(scenario: Scenario, calibrated: str = "") -> str:
    """The whole scenario as YAML, to run it again from any folder.

    Args:
        scenario: what was run.
        calibrated: the file of the calibrated robot that the controller knew, which no scenario named; empty
            for none.
    """
    kept = deepcopy(scenario)
    if calibrated:
        kept.servo.model = replace(kept.servo.model, robot=calibrated)
    _make_whole(kept)
    kept.servo.laws.own = {_whole(law): said for law, said in kept.servo.laws.own.items()}
    return scenario_text(kept)


def _make_whole(part: Any) -> None:
    """Makes paths of files whole in a tree of dataclasses."""
    for each in part if isinstance(part, list) else []:
        _make_whole(each)
    if not is_dataclass(part):
        return
    for entry in fields(part):
        value = getattr(part, entry.name)
        if declaration(entry).is_file:
            setattr(part, entry.name, _whole(value))
        else:
            _make_whole(value)


def file_of(name: str) -> Path | None:
    """The file that a name of a robot, a law or the like means; None for what is shipped or not there."""
    file, is_class, _ = name.partition(_CLASS)
    path = Path(f"{file}.py" if is_class else name)
    return path if path.suffix and path.is_file() else None  # what is shipped has no suffix


def named_files(scenario: Scenario) -> list[Path]:
    """The files that a scenario names; not those that these name in turn (`with_inner_files`)."""
    found = [file_of(name) for name in [*_names(scenario), *scenario.servo.laws.own]]
    return sorted({file for file in found if file})


def with_inner_files(files: Iterable[Path]) -> list[Path]:
    """Files with those that YAML files among them name in turn, from their own folders or from this one.

    Such are the robot that another one extends, or from which it was calibrated, and meshes of links.
    """
    found: dict[Path, Path] = {}  # by where they truly are
    left = list(files)
    while left:
        file = left.pop()
        if found.setdefault(file.resolve(), file) is file and file.suffix.lower() in YAML:
            with suppress(ConfigurationError):  # a row that cannot use it says so
                texts = _texts(read_nodes(file, f"file {file}").plain)
                places = (place for text in texts for place in (str(file.parent / text), text))
                left += filter(None, map(file_of, places))
    return sorted(found.values())


def _texts(value: Any) -> list[str]:
    """The texts in a tree of mappings and lists that may be the name of a file."""
    if isinstance(value, dict | list):
        inside = value.values() if isinstance(value, dict) else value
        return [text for each in inside for text in _texts(each)]
    is_name = isinstance(value, str) and len(value.encode()) <= _LONGEST and value.isprintable()
    return [value] if is_name else []


def _names(part: Any) -> list[str]:
    """What stands in the fields of a tree of dataclasses that name files."""
    if isinstance(part, list):
        return [name for each in part for name in _names(each)]
    if not is_dataclass(part):
        return []
    found: list[str] = []
    for entry in fields(part):
        value = getattr(part, entry.name)
        found += [value] if declaration(entry).is_file else _names(value)
    return found


def _whole(name: str) -> str:
    """The same file from any folder; what is no file that is there stays as it is."""
    path = file_of(name)
    if path is None:
        return name
    _, is_class, inside = name.partition(_CLASS)
    return f"{path.absolute()}:{inside}" if is_class else str(path.absolute())
