"""Commands that are imported when they are asked for: half of them would cost each of them a second.

Their help speaks of files and values, not of the types of Python.
"""

from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand
from typer.main import get_command_from_info, get_group
from typer.models import CommandInfo

from experiments.cli.former_options import renamed

FILES_HELP = "Columns and keys of files: reference/files.html in the manual, which make docs writes to site/."

_STAYING = "truetip.staying"  # in a context, what `stays` has noted

_running: ContextVar[Any] = ContextVar("running", default=None)  # the context of the command that runs


def option_with(value: str) -> str:
    """The option of the running command that was given this value; empty where there is none."""
    context = _running.get()
    options = [each for each in context.command.params if each.param_type_name == "option"] if context else []
    return next((each.opts[0] for each in options if str(context.params.get(each.name)) == value), "")


def naming(file: Path) -> list[str]:
    """The options and arguments of the running command that were given this file, however it is spelled."""
    return [_called(each) for each in _naming(file)]


def typed(file: Path) -> str:
    """The option or argument that was typed with this file behind it; empty where there is none."""
    context = _running.get()
    sources = ((each, context.get_parameter_source(each.name)) for each in _naming(file))
    return next((_called(each) for each, source in sources if source and source.name == "COMMANDLINE"), "")


def _naming(file: Path) -> list[Any]:
    context = _running.get()
    params = context.command.params if context else []
    found = []
    for each in params:
        given = context.params.get(each.name)
        values = given if isinstance(given, list | tuple) else [given]
        if any(isinstance(value, str | Path) and _is(file, value) for value in values):
            found.append(each)
    return found


def _called(parameter: Any) -> str:
    return parameter.opts[0] if parameter.param_type_name == "option" else _shown(parameter).strip("[].")


def stays(file: str | Path) -> None:
    """Notes a file that the running command writes where it stays, whatever becomes of its other results."""
    context = _running.get()
    if context is not None:
        context.meta.setdefault(_STAYING, []).append(Path(file))


def staying() -> list[Path]:
    """The files that the running command has written where they stay."""
    context = _running.get()
    return [file for file in context.meta.get(_STAYING, ()) if file.exists()] if context else []


def _is(file: Path, given: str | Path) -> bool:
    """Whether a value that was given is this file; what no file can be called is not."""
    try:
        return Path(given).resolve() == file.resolve()
    except (OSError, ValueError):
        return False


class PlainCommand(TyperCommand):
    """A command whose help names its arguments as they are typed and says where files are described."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Takes options by their former names, too."""
        return super().parse_args(ctx, renamed(ctx.command_path.partition(" ")[2], args))

    def invoke(self, ctx: Any) -> Any:
        """Runs it, and lets messages know what was typed."""
        token = _running.set(ctx)
        try:
            return super().invoke(ctx)
        finally:
            _running.reset(token)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """What stands behind the command's name."""
        return ["[OPTIONS]", *(_shown(each) for each in self._arguments())]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Arguments, then options, a line each."""
        arguments = [(_shown(each), each.help or "") for each in self._arguments()]
        if any(text for _, text in arguments):
            with formatter.section("Arguments"):
                formatter.write_dl(arguments)
        options = [
            each.get_help_record(ctx) for each in self.get_params(ctx) if each not in self._arguments()
        ]
        with formatter.section("Options"):
            formatter.write_dl([line for line in options if line])

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Where the files are described, for a command that reads or writes some."""
        if any("FILE" in (each.metavar or "") or "DIR" in (each.metavar or "") for each in self.params):
            formatter.write_paragraph()
            formatter.write_text(FILES_HELP)

    def _arguments(self) -> list[Any]:
        return [each for each in self.params if each.param_type_name == "argument"]


def _shown(argument: Any) -> str:
    """The name of an argument; one that may be left out in brackets."""
    name = str(argument.metavar or argument.name.upper())
    return name if argument.required else f"[{name}]"


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
        CommandInfo(name=name, callback=made_of, cls=PlainCommand),
        pretty_exceptions_short=True,
        rich_markup_mode=None,
    )
