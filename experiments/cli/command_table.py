"""Commands that are imported when they are asked for: half of them would cost each of them a second."""

from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from typing import Any

import typer
from typer.main import get_command_from_info, get_group
from typer.models import CommandInfo


class CommandTable(Mapping[str, Any]):
    """Commands by name, in the order of the help.

    Args:
        places: name -> ``module:function``, or ``module:app`` of a group of commands.
    """

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = places

    def __getitem__(self, name: str) -> Any:
        return _command(name, self._places[name])

    def __contains__(self, name: object) -> bool:
        return name in self._places  # without importing it

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


@cache
def _command(name: str, place: str) -> Any:
    module, member = place.split(":")
    made_of = getattr(import_module(module), member)
    if isinstance(made_of, typer.Typer):
        command: Any = get_group(made_of)
        command.name = name
        return command
    return get_command_from_info(
        CommandInfo(name=name, callback=made_of), pretty_exceptions_short=True, rich_markup_mode=None
    )
