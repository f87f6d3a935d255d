"""Whatever is wrong in an input, a command says so in one line with exit code 2 and leaves nothing behind."""

import shlex
import sys
from pathlib import Path

import pytest

from experiments.main import app
from experiments.manual.commands import commands
from tests.experiments.cli.wrong_inputs import FILES, REFUSED
from tests.experiments.commands import files, refusal, truetip

COMMANDS = dict(commands(app))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("inputs")
    for name, text in FILES.items():
        (found / name).write_text(text)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("line", "reason"), REFUSED.items(), ids=REFUSED)
def test_wrong_input_is_refused_in_one_line_and_nothing_is_written(
    line: str, reason: str, folder: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(folder)
    # Python keeps what it compiles of a law of one's own beside it; that is not ours.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    said = refusal(truetip(*shlex.split(line)))
    assert reason in said
    assert "Errno" not in said
    assert files(folder) == set(FILES)


def test_a_scenario_in_another_code_than_utf_8_is_named(tmp_path: Path):
    (tmp_path / "mine.yaml").write_text("extends: misaligned\ndescription: größer\n", encoding="latin-1")
    said = refusal(truetip("run", "--scenario", tmp_path / "mine.yaml"))
    assert said.endswith("mine.yaml: not a text file in UTF-8\n")


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_refuses_an_unknown_option_and_an_option_without_its_value(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    assert f"{name}: no option --nonesuch" in refusal(truetip(*name.split(), "--nonesuch"))
    taking = [each for each in COMMANDS[name].params if each.param_type_name == "option" and not each.is_flag]
    for option in taking[-1:]:
        assert option.opts[0] in refusal(truetip(*name.split(), option.opts[0]))
    assert files(tmp_path) == set()


def test_the_table_is_long_enough_to_mean_something():
    assert len(REFUSED) >= 160
