"""The frame of all commands: plain help, and one line for what was typed wrongly."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup
from typer.exceptions import TyperException

from experiments.cli.command_table import CommandTable, PlainCommand
from experiments.cli.console import BAD_INPUT, fail
from robots.configuration.suggestion import did_you_mean

_NO_OPTION = re.compile(r"No such option: (\S+)")
_IN_OTHER_WORDS = re.compile(r"Invalid value for '([^']*)': Input should be a valid (\w+).*")
_KINDS = {"integer": "a whole number", "number": "a number", "boolean": "true or false"}
_EXTRA = re.compile(r"Got unexpected extra argument\S* \(([^)]*)\)")
_NO_COMMAND = re.compile(r"No such command '([^']*)'")


class _Commands(TyperGroup):
    """A group whose errors are one line, those of the commands in it too."""

    def make_context(self, info_name: str | None, args: list[str], *more: Any, **extra: Any) -> Any:
        if not args:  # the help, which is long
            return super().make_context(info_name, args, *more, **extra)
        try:
            return super().make_context(info_name, args, *more, **extra)
        except TyperException as error:
            fail(_line(error), BAD_INPUT)

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except TyperException as error:
            if "\n" in error.message:  # the help of a group of commands that was named alone
                raise
            fail(_line(error, f"{ctx.command_path} {ctx.invoked_subcommand or ''}"), BAD_INPUT)


class _App(typer.Typer):
    """An app whose commands show the plain help."""

    def command(self, name: str | None = None, *, cls: Any = PlainCommand, **more: Any) -> Any:
        """As that of typer, with another class of command unless one is named."""
        return super().command(name, cls=cls, **more)


def command_app(
    help_text: str,
    no_args_is_help: bool = True,
    completes: bool = False,
    table: Mapping[str, str] | None = None,
) -> typer.Typer:
    """A group of commands.

    Args:
        help_text: what they are for.
        no_args_is_help: whether the group named alone shows its help.
        completes: adds options that install or show the completion of a shell.
        table: commands to import when they are asked for; see `CommandTable`.
    """

    class Commands(_Commands):
        def __init__(self, **given: Any) -> None:
            super().__init__(**given)
            if table is not None:
                self.commands: Any = CommandTable(table)

    return _App(
        cls=Commands,
        help=help_text,
        no_args_is_help=no_args_is_help,
        add_completion=completes,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    )


def _plainly(found: re.Match[str]) -> str:
    return f"{found.group(1)} must be {_KINDS.get(found.group(2), found.group(2))}"


def _given(error: Any) -> str:
    """What was typed in place of a value, as the check behind the error keeps it."""
    checked = getattr(error.__cause__, "errors", None)
    return f", got '{checked()[0]['input']}'" if checked else ""


def _takers(file: str, options: list[Any]) -> list[str]:
    """Names of the options that take a file of this kind."""
    suffix = Path(file).suffix
    if not suffix or " " in file:  # a word, or several of them
        return []
    return [each.opts[0] for each in options if f"FILE{suffix}" in (each.metavar or "").split("|")]


def _line(error: Any, otherwise: str = "truetip") -> str:
    """What was wrong, in which command, what was probably meant, and where to look."""
    context = getattr(error, "ctx", None)
    path = context.command_path if context else otherwise.strip()
    message = error.format_message().rstrip(".")
    command = context.command if context else None
    if option := _NO_OPTION.search(message):
        known = [name for each in command.params for name in each.opts] if command else []
        message = f"no option {option.group(1)}{did_you_mean(option.group(1), known)}"
    elif extra := _EXTRA.search(message):
        message = f"nothing is done with '{extra.group(1)}'"
        takers = _takers(extra.group(1), command.params if command else [])
        message += f": did you mean {takers[0]} {extra.group(1)}?" if takers else ""
    elif name := _NO_COMMAND.search(message):
        message = f"no command {name.group(1)}{did_you_mean(name.group(1), getattr(command, 'commands', {}))}"
    else:
        message = _IN_OTHER_WORDS.sub(lambda found: _plainly(found) + _given(error), message)
        message = message[:1].lower() + message[1:]
    where = path.removeprefix("truetip").strip()
    return f"{where}: {message} ({path} --help)" if where else f"{message} ({path} --help)"
