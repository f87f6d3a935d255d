"""One word, one meaning: an option is the same in every command, and the help speaks of what is typed."""

import os
import re
import subprocess
import sys
from collections import defaultdict
from typing import Any

import pytest

from experiments.cli.command_table import FILES_HELP
from experiments.main import app
from experiments.manual.commands import commands
from tests.experiments.commands import truetip

COMMANDS = dict(commands(app))
VALUES = {
    "--out": "DIR",
    "--report": "FILE.html",
    "--json": "FILE|-",
    "--jobs": "N",
    "--seed": "N",
    "--set": "KEY=VALUE",
    "--scenario": "NAME|FILE",
    "--law": "NAME|FILE:CLASS",
    "--laws": "A,B,...",
    "--camera": "NAME",
    "--cell": "NAME|FILE",
    "--payload": "KG",
}
# The same thing in another form: what is written or read has the format of its command, and a choice of
# robots or of motions is as wide as the command can use.
FORMS = {"--write", "--write-recording", "--recording", "--robot", "--plant"}


def options(command: Any) -> list[Any]:
    return [each for each in command.params if each.param_type_name == "option"]


def by_name() -> dict[str, list[tuple[str, Any]]]:
    found = defaultdict(list)
    for command, made in COMMANDS.items():
        for option in options(made):
            for name in option.opts:
                found[name].append((command, option))
    return found


@pytest.mark.parametrize(("name", "value"), VALUES.items())
def test_what_many_commands_take_is_one_kind_of_value(name: str, value: str):
    assert {command: option.metavar for command, option in by_name()[name] if option.metavar != value} == {}


def test_an_option_is_a_flag_everywhere_or_nowhere_and_its_value_has_one_name():
    for name, found in by_name().items():
        kinds = {(option.is_flag, None if name in FORMS else option.metavar) for _, option in found}
        assert len(kinds) == 1, (name, {command: option.metavar for command, option in found})


def test_every_option_with_a_value_says_what_it_is_and_every_option_has_a_help():
    for name, found in by_name().items():
        for command, option in found:
            assert option.help, (command, name)
            assert option.is_flag or option.metavar, (command, name)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_names_values_as_they_are_typed_and_says_where_files_are_described(command: str):
    text = truetip(*command.split(), "--help").stdout
    assert not re.search(r"<\w+|\blist\[|\{", text), text
    takes_files = any(re.search("FILE|DIR", each.metavar or "") for each in COMMANDS[command].params)
    groups = getattr(COMMANDS[command], "commands", None)  # shows its commands and takes no file itself
    assert (" ".join(FILES_HELP.split()) in " ".join(text.split())) == (takes_files and not groups)


@pytest.mark.slow  # each starts a command, as a shell does
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("comp", ["compare", "compensate"]),
        ("compare --scenario mis", ["misaligned"]),
        ("compare --robot kr1", ["kr16", "kr16-realistic"]),
        ("run --law pb", ["pbvs"]),
        ("compare --scenario mine", []),
    ],
)
def test_a_shell_is_offered_commands_and_names(words: str, offered: list[str]):
    typed = f"truetip {words}"
    shell = {
        "COMP_WORDS": typed,
        "COMP_CWORD": str(words.count(" ") + 1),
        "_TRUETIP_COMPLETE": "complete_bash",
    }
    code = "import sys; sys.argv = ['truetip']; from experiments.main import main; main()"
    run = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **shell}, capture_output=True, text=True
    )
    assert run.stdout.split() == offered
