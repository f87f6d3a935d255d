"""The tables of accuracy: every row is a command that runs, and a page gets them where it has a place."""

import json
import shlex
from pathlib import Path

import pytest

from experiments.bench.accuracy.rows import COMMAND, SECTIONS, Row
from experiments.bench.accuracy.tables import read_results, table, write_tables
from experiments.robustness import command
from tests.experiments.commands import truetip

ROWS = [row for section in SECTIONS.values() for row in section]


def result(**more) -> dict:
    laps = [
        {"max_norm_mm": (0.0402, 0.02), "max_angle_deg": (0.006, 0.004), "times_planned": (1.4, 1.2)},
        {"max_norm_mm": (0.0099, 0.007), "max_angle_deg": (0.001, 0.001), "times_planned": (1.001, 1.0)},
    ]
    found = {"case": "plain", "runs": 20, "failures": [], "laps": laps, "static_mm": (0.0028, 0.0017)}
    return found | {"coverage": (0.944, 0.975)} | more


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_every_row_is_a_command_whose_runs_are_possible(row: Row, monkeypatch):
    begun = []

    def run_trials(todo, where, progress):
        begun.extend(todo)
        raise ValueError("far enough")

    monkeypatch.setattr(command, "run_trials", run_trials)
    monkeypatch.setattr(command, "with_calibrated_robots", lambda todo, *_: todo)
    answer = truetip(*COMMAND.split(), *shlex.split(row.options), "--jobs", "1")
    assert "far enough" in answer.output
    assert len(begun) >= 2
    assert all(trial.laps == 2 and trial.contender.law == "self_calibrating" for trial in begun)


def test_names_are_those_of_one_row_each():
    names = [row.name for row in ROWS]
    assert len(set(names)) == len(names)


def test_a_table_has_a_line_for_each_case_with_the_worst_and_the_median():
    one, two = Row("a", "--cases plain", "as it is"), Row("b", "--cases egm,tool-displaced")
    lines = table(
        [
            (one, [result()]),
            (two, [result(case="egm"), result(case="tool-displaced", recovered_mm=(0.03, 0.02))]),
        ]
    ).splitlines()
    assert [line.count("|") for line in lines] == [8] * 5
    assert (
        "`--cases plain`: as it is | 20 | 0.040 (0.020), 0.006, × 1.40 (1.20) | 0.010 (0.007), 0.001 |"
        in lines[2]
    )
    assert "0.0028 (0.0017) |  | 0.975, 0.944" in lines[2]
    assert lines[3].startswith("| `--cases egm,tool-displaced` egm |")
    assert lines[4].startswith("| tool-displaced | 20 |  | 0.010")  # the first lap has the blow in it
    assert "| 0.030 (0.020) |" in lines[4]


def test_a_row_that_was_measured_before_times_were_kept_says_nothing_of_them():
    older = [{name: lap[name] for name in ("max_norm_mm", "max_angle_deg")} for lap in result()["laps"]]
    line = table([(Row("a", "--cases plain"), [result(laps=older)])]).splitlines()[-1]
    assert "| 0.040 (0.020), 0.006 | 0.010 (0.007), 0.001 |" in line


def test_a_run_that_broke_off_is_no_row(tmp_path: Path):
    file = tmp_path / "row.json"
    file.write_text(json.dumps({"results": [result(failures=["seed 3, circle: out of reach"])]}))
    with pytest.raises(ValueError, match="seed 3, circle: out of reach"):
        read_results(file)


def test_a_page_gets_its_tables_and_keeps_the_rest(tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text("before\n\n<!-- accuracy: a -->\nold\n<!-- end -->\n\nafter\n")
    for _ in range(2):
        write_tables(page, {"a": "| new |"})
        assert page.read_text() == "before\n\n<!-- accuracy: a -->\n\n| new |\n\n<!-- end -->\n\nafter\n"
    with pytest.raises(ValueError, match="has places for a, not for a, b"):
        write_tables(page, {"a": "", "b": ""})
