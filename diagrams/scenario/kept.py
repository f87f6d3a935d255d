"""A scenario as it is kept beside results: it names the same files wherever it is read."""

from copy import deepcopy
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from diagrams.scenario.scenario import Scenario, scenario_text
from robots.configuration.quantity import declaration

_CLASS = ".py:"  # before the name of a class in a file


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


def _whole(name: str) -> str:
    """The same file from any folder; what is no file that is there stays as it is."""
    file, is_class, inside = name.partition(_CLASS)
    path = Path(f"{file}.py" if is_class else name)
    if not path.suffix or not path.is_file():  # what is shipped has no suffix
        return name
    return f"{path.absolute()}:{inside}" if is_class else str(path.absolute())
