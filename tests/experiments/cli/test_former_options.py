"""What was typed yesterday runs today: options by their former names."""

import json
from pathlib import Path

import pytest

from experiments.cli.former_options import FORMER, renamed
from experiments.main import app
from experiments.manual.commands import commands
from tests.experiments.commands import truetip

OPTIONS = {
    name: {each for option in command.params for each in option.opts} for name, command in commands(app)
}


@pytest.mark.parametrize(("command", "names"), FORMER.items(), ids=FORMER)
def test_a_former_name_stands_for_an_option_and_for_none_of_another_meaning(
    command: str, names: dict[str, str]
):
    known = OPTIONS[command]
    assert set(names.values()) <= known
    assert not set(names) & known


def test_names_are_replaced_and_values_are_not():
    assert renamed("identify", ["--cases", "a.yaml", "--seed=1"]) == ["--motions", "a.yaml", "--seed=1"]
    assert renamed("compensate", ["p.mod", "--out=q.mod", "--", "--out"]) == [
        "p.mod", "--write=q.mod", "--", "--out"
    ]  # fmt: skip
    assert renamed("compare", ["--out", "folder"]) == ["--out", "folder"]


def test_the_folder_of_feedforward_holds_its_page():
    page = str(Path("folder/feedforward.html"))
    assert renamed("feedforward", ["--out", "folder"]) == ["--report", page]
    assert renamed("feedforward", ["--out=folder", "--grid", "2"]) == [f"--report={page}", "--grid", "2"]


@pytest.mark.slow
def test_a_command_runs_with_them(tmp_path: Path):
    page = tmp_path / "z.html"
    done = truetip("zeros", "--example", "beam", "--out", page, "--json", "-")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["poses"] >= 1
    assert page.exists()
