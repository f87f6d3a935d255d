"""The commands as pages: what ``--help`` says of each, from the same declarations."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from experiments.manual.markdown import table


def commands(app: typer.Typer) -> Iterator[tuple[str, Any]]:
    """Every command with its name as it is typed, such as ``cameras study``, in alphabetical order."""
    yield from sorted(_below("", typer.main.get_command(app)), key=lambda found: found[0])


def _below(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    inside = getattr(command, "commands", {})
    if name and (not inside or getattr(command, "invoke_without_command", False)):
        yield name, command
    for inner, each in inside.items():
        yield from _below(f"{name} {inner}".strip(), each)


def page_name(name: str) -> str:
    """The file of a command below ``reference/commands``."""
    return f"{name.replace(' ', '-')}.md"


def overview(app: typer.Typer) -> str:
    """A page with a line for each command."""
    rows = [(f"[`truetip {name}`]({page_name(name)})", summary(each)) for name, each in commands(app)]
    return (
        "# Commands\n\nEvery option stands on the page of its command, and behind `--help`. A command ends "
        "with exit code 0, with 2 and one line where its input is wrong, and with 1 where a run broke off; "
        "where it does not end with 0, nothing is half-written.\n\n" + table(("command", "does"), rows)
    )


def summary(command: Any) -> str:
    """The first line of a command's help."""
    return (command.help or "").strip().split("\n")[0]


def command_page(name: str, command: Any) -> str:
    """Usage, arguments and options of one command."""
    context = typer.Context(command, info_name=f"truetip {name}")
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    parts = [f"# truetip {name}", (command.help or "").strip(), f"```sh\n{usage}\n```"]
    arguments = [each for each in command.params if each.param_type_name == "argument"]
    options = [each for each in command.params if each.param_type_name == "option"]
    if arguments:
        rows = [(f"`{_value_name(each)}`", each.help or "") for each in arguments]
        parts.append("## Arguments\n\n" + table(("argument", "meaning"), rows))
    shown = [_option_row(each) for each in options if not each.hidden]
    parts.append("## Options\n\n" + table(("option", "value", "meaning", "default"), [*shown, _HELP_ROW]))
    return "\n\n".join(parts) + "\n"


_HELP_ROW = ("`-h`, `--help`", "", "Show this and exit.", "")


def _value_name(parameter: Any) -> str:
    return str(parameter.metavar or parameter.name.upper())


def _option_row(option: Any) -> tuple[str, str, str, str]:
    names = ", ".join(f"`{name}`" for name in [*option.opts, *option.secondary_opts])
    value = "" if option.is_flag else f"`{_value_name(option)}`"
    return names, value, option.help or "", _default(option)


def _default(option: Any) -> str:
    if isinstance(option.show_default, str):
        return option.show_default
    value = option.default
    if option.is_flag or not isinstance(value, str | int | float | Path) or str(value) == "":
        return ""
    return f"`{value}`"
