"""Commands that are imported when they are asked for: half of them would cost each of them a second."""

from collections.abc import Iterator, Mapping, MutableMapping
from importlib import import_module
from typing import Any

import typer
from typer.main import get_command_from_info, get_group
from typer.models import CommandInfo


class CommandTable(MutableMapping[str, Any]):
    """Commands by name, in the order of the help.

    Args:
        places: name -> ``module:function``, or ``module:app`` of a group of commands.
    """

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = dict(places)
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            module, member = self._places[name].split(":")
            self._made[name] = _command(name, getattr(import_module(module), member))
        return self._made[name]

    def __setitem__(self, name: str, command: Any) -> None:
        self._places.setdefault(name, "")
        self._made[name] = command

    def __delitem__(self, name: str) -> None:
        del self._places[name]
        self._made.pop(name, None)

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


def _command(name: str, made_of: Any) -> Any:
    if isinstance(made_of, typer.Typer):
        command: Any = get_group(made_of)
        command.name = name
        return command
    return get_command_from_info(
        CommandInfo(name=name, callback=made_of), pretty_exceptions_short=True, rich_markup_mode=None
    )
