"""The numbers of a command go where they were asked for, and only when all of it has ended well."""

import json
from pathlib import Path

import pytest

from experiments.cli.json_output import human_console, json_output
from experiments.cli.staging import staged_file
from tests.experiments.commands import files

NUMBERS = {"b": 1.5, "a": [1, None, "µm"]}


def test_a_file_gets_what_stdout_would_show(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for place in (str(tmp_path / "new/numbers.json"), "-"):
        with json_output(place) as output, output.staged():
            output.write(NUMBERS)
    shown = capsys.readouterr().out
    assert json.loads(shown) == NUMBERS
    assert (tmp_path / "new/numbers.json").read_text(encoding="utf-8") == shown


def test_without_the_option_they_go_nowhere(tmp_path: Path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with json_output(None) as output, output.staged():
        output.write(NUMBERS)
    assert capsys.readouterr().out == ""
    assert files(tmp_path) == set()


def test_stdout_shows_them_when_the_other_results_are_in_their_places(tmp_path: Path, capsys, monkeypatch):
    shown = []
    monkeypatch.setattr("sys.stdout.write", lambda text: shown.append((text, files(tmp_path))))
    with json_output("-") as output, staged_file(tmp_path / "page.html") as page, output.staged():
        page.write_text("a page")
        output.write(NUMBERS)
    ((text, there),) = shown
    assert json.loads(text) == NUMBERS
    assert there == {"page.html"}


@pytest.mark.parametrize("name", ["numbers.json", "-"])
def test_what_fails_later_leaves_no_numbers(tmp_path: Path, capsys, monkeypatch, name: str):
    monkeypatch.chdir(tmp_path)

    def fail() -> None:
        with json_output(name) as output, output.staged():
            output.write(NUMBERS)
            raise RuntimeError("defect")

    with pytest.raises(RuntimeError, match="defect"):
        fail()
    assert capsys.readouterr().out == ""
    assert files(tmp_path) == set()


@pytest.mark.parametrize("name", ["numbers.json", "-"])
def test_a_number_that_json_does_not_know_is_refused(tmp_path: Path, monkeypatch, name: str):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="not JSON compliant"), json_output(name) as output, output.staged():
        output.write({"a": float("nan")})


def test_people_are_told_on_stderr_only_where_the_numbers_have_stdout():
    assert [human_console(name).stderr for name in (None, "numbers.json", "-")] == [False, False, True]
