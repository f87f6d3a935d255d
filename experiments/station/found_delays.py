"""A scenario file with the delays that a measurement found, on top of the scenario that was measured."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.station.latency import Latency

_DELAYS = ("station.period", "station.drive.command_delay", "station.drive.dead_time", "station.camera.delay")


def check_settings(settings: Sequence[str]) -> None:
    """Refuses settings that cannot stand in one file with the delays.

    Raises:
        ValueError: if one of two settings, or a setting and a delay, is within the other.
    """
    _tree(settings, dict.fromkeys(_DELAYS, 0.0))


def scenario_with(name: str, found: Latency, settings: Sequence[str] = (), file: Path | None = None) -> str:
    """A scenario file that extends another by what was set of it and by the delays that were found.

    Args:
        name: the scenario that was measured, a shipped one or the path of a file.
        found: its delays.
        settings: what was set of it, such as ``"station.payload=2"``; a delay that was found comes last.
        file: where the text will be, from where the scenario is named; None for the working directory.

    Raises:
        ValueError: see `check_settings`.
    """
    # One cycle is the least: a command is interpolated over it.
    values = [found.cycle, found.cycle, max(0.0, found.dead_time)]
    values += [] if found.camera is None else [max(0.0, found.camera)]
    tree = _tree(settings, dict(zip(_DELAYS, values, strict=False)))
    named = _seen_from(file, name).replace("'", "''")
    head = ["# Delays as `truetip latency` found them.", f"extends: '{named}'"]
    return "\n".join([*head, *_lines(tree, "")]) + "\n"


def _tree(settings: Sequence[str], delays: Mapping[str, float]) -> dict[str, Any]:
    """Settings and delays (s, by their places) as a tree of keys with texts of YAML as leaves."""
    tree: dict[str, Any] = {}
    pairs = [setting.partition("=")[::2] for setting in settings]
    for key, value in [*pairs, *((key, f"{delay:.6f}") for key, delay in delays.items())]:
        *groups, last = key.strip().split(".")
        place = tree
        for group in groups:
            inner = place.setdefault(group, {})
            if not isinstance(inner, dict):
                raise _refuse(f"{group}={inner}", key)
            place = inner
        if isinstance(place.get(last), dict):
            raise _refuse(f"{key}={value}", key)
        place[last] = value.strip()
    return tree


def _refuse(setting: str, key: str) -> ValueError:
    return ValueError(
        f"--write: --set ...{setting} and {key} cannot stand in one file; put what is set into a scenario "
        "file and give that to --scenario"
    )


def _seen_from(file: Path | None, name: str) -> str:
    """The name of a scenario as a file has to say it."""
    path = Path(name)
    if file is None or path.suffix not in (".yaml", ".yml"):
        return name
    path, folder = path.resolve(), file.resolve().parent
    return Path(os.path.relpath(path, folder) if path.anchor == folder.anchor else path).as_posix()


def _lines(tree: Mapping[str, Any], indent: str) -> list[str]:
    lines = []
    for key, value in tree.items():
        if isinstance(value, dict):
            lines += [f"{indent}{key}:", *_lines(value, f"{indent}  ")]
        else:
            lines.append(f"{indent}{key}: {value}")
    return lines
