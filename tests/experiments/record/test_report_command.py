"""``truetip report`` and ``truetip runs``: what was found stays to be found."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from diagrams.record.log import GuardEvent, RunLog
from diagrams.scenario.scenario import load_scenario
from experiments.comparison.errors_table import read_errors, write_errors
from experiments.metrics.run_metrics import summary
from experiments.record.runs_beside import folder_names
from experiments.record.runs_command import runs_below
from experiments.record.simulated import write_records
from experiments.report.files import write_json
from tests.experiments.browser import open_page
from tests.experiments.commands import SHORT, files, refusal, truetip
from tests.experiments.synthetic import comparison


@pytest.fixture(scope="module")
def logs() -> dict[str, list[RunLog]]:
    found = comparison(cycles=2, with_joints=True)
    return {law: list(found[law]) for law in ("open_loop", "pbvs")}


@pytest.mark.slow
def test_the_report_of_records_is_that_of_the_runs(logs: dict[str, list[RunLog]], tmp_path: Path):
    write_records(tmp_path, "# line one (payload=3)\nseed: 0\n", logs)
    records = sorted(tmp_path.glob("*.mcap"))
    assert len(records) == 4
    result = truetip("report", *records, "--report", tmp_path / "page.html", "--json", "-")
    assert result.exit_code == 0, result.output
    again, first = json.loads(result.stdout), summary("line one (payload=3)", logs)
    assert again["scenario"] == "line one (payload=3)"
    for law, run in first["runs"].items():
        for key in ("max_norm_mm", "rms_norm_mm"):
            # A record keeps quaternions and nanoseconds.
            assert again["runs"][law]["true"][key] == pytest.approx(run["true"][key], rel=1e-6)
        assert again["runs"][law]["true"]["iso_9283"]["cycles"] == 2
    assert (tmp_path / "page.html").stat().st_size < 2.5e6


@pytest.mark.slow
def test_records_say_which_run_the_guard_stopped_and_so_does_their_report(
    logs: dict[str, list[RunLog]], tmp_path: Path
):
    whole, other = logs["pbvs"]
    stop = GuardEvent(3.0, "stopped", "joint 2 left its path", lasted=whole.time[-1] - 3.0)
    write_records(tmp_path, "", {"pbvs": [whole, replace(other, guard_events=[stop])]})
    records = sorted(tmp_path.glob("*.mcap"))
    said = "cycle 2: the guard stopped the robot at 3.0 s and it did not go on"
    result = truetip("report", *records, "--report", tmp_path / "page.html")
    assert result.exit_code == 1
    assert result.stderr == f"truetip: law pbvs: {said}\n"
    assert "Did not come to the end of its path: PBVS" in result.stdout
    assert f"PBVS did not come to the end of its path: {said}." in (tmp_path / "page.html").read_text()
    assert "the guard stopped the robot at 3.0 s" in truetip("log", records[1]).stdout


def test_cycles_that_ended_alike_are_named_once(logs: dict[str, list[RunLog]]):
    stop = GuardEvent(3.0, "stopped", "", lasted=100.0)
    cycles = [replace(log, guard_events=[stop]) for log in logs["pbvs"]]
    said = summary("", {"pbvs": cycles})["runs"]["pbvs"]["unfinished"]
    assert said == "cycles 1, 2: the guard stopped the robot at 3.0 s and it did not go on"


@pytest.mark.slow
def test_one_run_twice_is_refused(logs: dict[str, list[RunLog]], tmp_path: Path):
    write_records(tmp_path, "", {"pbvs": logs["pbvs"][:1]})
    before = files(tmp_path)
    record = tmp_path / "pbvs-1.mcap"
    said = refusal(truetip("report", record, record, "--report", tmp_path / "page.html"))
    assert "a run of law pbvs with seed 0 is there twice" in said
    assert files(tmp_path) == before


def test_runs_of_two_scenarios_are_refused_with_what_differs(logs: dict[str, list[RunLog]], tmp_path: Path):
    for number, (law, cycles) in enumerate(logs.items()):
        text = f"law: {law}\nseed: {number}\nstation: {{payload: {number}.0, period: 0.004}}\n"
        write_records(tmp_path, text, {law: cycles[:1]})
    records = sorted(tmp_path.glob("*.mcap"))
    said = refusal(truetip("report", *records, "--report", tmp_path / "page.html"))
    assert "pbvs-1.mcap: a run of another scenario than" in said
    assert "station.payload is 1 here and 0 there" in said


def test_an_index_has_a_line_for_each_law_with_its_figures(logs: dict[str, list[RunLog]], tmp_path: Path):
    for name in ("a", "b/c"):
        (tmp_path / name).mkdir(parents=True)
        write_json(tmp_path / name / "summary.json", summary(f"scenario {name}", logs))
        (tmp_path / name / "report.html").write_text("")
    found = list(runs_below(tmp_path, []))
    assert len(found) == 4
    expected = summary("", logs)["runs"]["pbvs"]["true"]["max_norm_mm"]
    assert {each["max_norm_mm"] for each in found if each["law"] == "pbvs"} == {expected}
    result = truetip("runs", tmp_path, "--report", tmp_path / "pages" / "runs.html")
    assert result.exit_code == 0, result.output
    page = (tmp_path / "pages" / "runs.html").read_text()
    assert 'href="../b/c/report.html"' in page
    assert "4 laws in 2 comparisons" in page


def test_a_summary_of_something_else_is_left_out_and_named(logs: dict[str, list[RunLog]], tmp_path: Path):
    write_json(tmp_path / "summary.json", summary("it", logs))
    for name, text in (("x", '{"runs": {"pbvs": {}}}'), ("y", "no JSON")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "summary.json").write_text(text)
    result = truetip("runs", tmp_path, "--report", tmp_path / "runs.html")
    assert "2 laws in 1 comparison" in result.output
    assert {str(tmp_path / name / "summary.json") in result.output for name in "xy"} == {True}


@pytest.mark.slow
def test_words_in_the_filter_hide_the_other_lines(logs: dict[str, list[RunLog]], tmp_path: Path):
    write_json(tmp_path / "summary.json", summary("it", logs))
    truetip("runs", tmp_path, "--report", tmp_path / "runs.html")
    page = tmp_path / "runs.html"
    typed = (
        '<script>const field = document.querySelector("input.filter"); field.value = "pbvs it"; '
        "field.oninput();</script></body>"
    )
    page.write_text(page.read_text().replace("</body>", typed))
    opened = open_page(page, 3000)
    assert not [line for line in opened.console if "rror" in line]
    assert opened.dom.count('<tr hidden="">') == 1


@pytest.mark.slow
def test_two_runs_side_by_side_show_what_differs_and_by_how_much(tmp_path: Path):
    shared = ["run", "--law=pbvs", *SHORT]
    for name, delay in (("early", "0.004"), ("late", "0.012")):
        assert (
            truetip(*shared, f"--set=station.camera.delay={delay}", "--out", tmp_path / name).exit_code == 0
        )
    page = tmp_path / "page.html"
    result = truetip(
        "runs",
        tmp_path / "early",
        "--beside",
        tmp_path / "late",
        "--report",
        page,
        "--json",
        tmp_path / "both.json",
    )
    assert result.exit_code == 0, result.output
    both = json.loads((tmp_path / "both.json").read_text())
    early, late = (
        both[str(tmp_path / name)]["runs"]["pbvs"]["true"]["max_norm_mm"] for name in ("early", "late")
    )
    assert (
        f"PBVS {early:.3g} → {late:.3g} mm; one field of the scenario changed, the same versions."
        in " ".join(result.stdout.split())
    )
    assert "<td>station.camera.delay</td><td>0.004</td><td>0.012</td>" in page.read_text()
    # The table of errors has the largest error of the summary, and the scenario can be run again.
    time, distance, _ = read_errors(tmp_path / "early" / "errors.csv")["pbvs"]
    assert distance[time >= 0.2 - 1e-9].max() == pytest.approx(early, rel=1e-5)
    assert load_scenario(str(tmp_path / "late" / "scenario.yaml")).station.camera.delay == 0.012


def test_an_index_says_which_run_did_not_come_to_its_end(logs: dict[str, list[RunLog]], tmp_path: Path):
    (whole,) = logs["pbvs"][:1]
    stop = GuardEvent(3.0, "stopped", "joint 2 left its path", lasted=whole.time[-1])
    for name, log in (("a", whole), ("b", replace(whole, guard_events=[stop]))):
        (tmp_path / name).mkdir()
        write_json(tmp_path / name / "summary.json", summary(name, {"pbvs": [log]}))
        write_errors(tmp_path / name / "errors.csv", {"pbvs": log})
        (tmp_path / name / "scenario.yaml").write_text("extends: misaligned\n")
    truetip("runs", tmp_path, "--report", tmp_path / "runs.html")
    assert (tmp_path / "runs.html").read_text().count(", did not finish") == 1
    result = truetip("runs", tmp_path / "a", "--beside", tmp_path / "b", "--report", tmp_path / "both.html")
    assert f"PBVS did not come to the end of its path in {tmp_path / 'b'}." in " ".join(result.stdout.split())


@pytest.mark.parametrize(
    ("folders", "names"),
    [
        (("out/early", "out/late"), ["early", "late"]),
        (("out/a/run", "out/b/run"), ["a/run", "b/run"]),
        (("out", "out/late"), ["out", "out/late"]),
        (("out", "out"), ["out", "out"]),
    ],
)
def test_folders_are_named_by_what_tells_them_apart(folders: tuple[str, str], names: list[str]):
    assert folder_names(*map(Path, folders)) == names


def test_a_folder_that_is_no_run_is_refused_beside_another(tmp_path: Path):
    (tmp_path / "empty").mkdir()
    said = refusal(
        truetip("runs", tmp_path, "--beside", tmp_path / "empty", "--report", tmp_path / "page.html")
    )
    assert "there is no summary.json, which compare and run write" in said


@pytest.mark.parametrize(
    ("text", "reason"), [("{}", "summary.json is none of theirs"), (None, "there is no summary.json")]
)
def test_a_folder_without_runs_is_refused(text: str | None, reason: str, tmp_path: Path):
    if text is not None:
        (tmp_path / "summary.json").write_text(text)
    assert reason in refusal(truetip("runs", tmp_path, "--report", tmp_path / "runs.html"))
