"""``truetip design --program``: files beside the table, all at once, and what is refused."""

import re
from pathlib import Path

import pytest

from tests.experiments.commands import files, refusal, truetip


@pytest.mark.slow
def test_the_run_stands_beside_the_configurations(tmp_path: Path):
    written = {"run.src", "run.dat"}
    arguments = ["--count", 12, "--write", tmp_path / "run.csv", "--report", tmp_path / "page.html"]
    result = truetip("design", *arguments, "--program", "krl")
    assert result.exit_code == 0, result.output
    assert files(tmp_path) == written | {"run.csv", "page.html", "run_measured.csv"}
    assert all((tmp_path / name).name in result.stdout.replace("\n", "") for name in written)
    assert len((tmp_path / "run_measured.csv").read_text().splitlines()) == 2 + 12


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--program", "fanuc"], "--program must be one of rapid, krl, got 'fanuc'"),
        (["--settle", "1"], "--settle and --trigger need --program"),
        (["--program", "krl", "--trigger", "doX"], "must be the number of a digital output in KRL"),
    ],
)
def test_refusals_come_before_the_search(options: list, message: str, tmp_path: Path):
    arguments = ["--write", tmp_path / "run.csv", "--report", tmp_path / "page.html"]
    assert message in refusal(truetip("design", *arguments, *options))
    assert files(tmp_path) == set()


@pytest.mark.slow
def test_a_table_that_somebody_has_filled_stays(tmp_path: Path):
    """Before the search, where it holds places; after it, where it may hold joints as they were noted."""
    design = ["design", "--count", 9, "--anywhere", "--program", "rapid"]
    design += ["--write", tmp_path / "run.csv", "--report", tmp_path / "page.html"]
    table = tmp_path / "run_measured.csv"
    for _ in range(2):  # what is there and the same is no obstacle
        assert truetip(*design).exit_code == 0
    blank = table.read_text()
    for filled, why in (
        (blank.replace(",,,,,,\n", ",1,2,3,4,5,6\n", 1), "holds measurements"),
        (re.sub(r"\n-?[\d.]+,", "\n1.5,", blank, count=1), "is there and is not the table of this run"),
    ):
        table.write_text(filled)
        assert f"{table} {why}" in refusal(truetip(*design))
        assert table.read_text() == filled
