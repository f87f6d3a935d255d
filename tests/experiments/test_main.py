"""The command line: what it writes, what it refuses, and that the same seed gives the same bytes."""

import json
import os
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from diagrams.scenario.scenario import load_scenario, shipped_scenarios
from experiments import main
from experiments.cli.command_table import stays
from experiments.cli.prepare import check, prepare
from experiments.running import compare_command, run_command
from robots.description.model import shipped_robots
from tests.experiments.commands import RESULTS, SHORT, files, refusal, truetip


@pytest.fixture(autouse=True)
def _work_in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    # Rich wraps at the width of the terminal that runs the tests.
    monkeypatch.setenv("COLUMNS", "200")


REFUSED = {
    "unknown key": (["compare", "--set=station.cammera.delay=0.004"], "unknown key 'station.cammera'"),
    "wrong unit": (
        ["compare", "--set=station.camera.delay=4"],
        "station.camera.delay must be between 0 and 1 s",
    ),
    "no number": (["compare", "--set=station.payload=7kg"], "station.payload must be a number, got '7kg'"),
    "too heavy": (["compare", "--set=station.payload=9"], "must be between 0 and 7.0 kg"),
    "no integrator": (["compare", "--set=integrator.scheme=magic"], "magic"),
    "no scenario": (["compare", "--scenario=nope.yaml"], "no file nope.yaml"),
    "broken scenario": (["compare", "--scenario=broken.yaml"], "broken.yaml"),
    "no robot": (["compare", "--robot=nope"], "robot 'nope'"),
    "no robot file": (["run", "--robot=nope.yaml"], "no file nope.yaml"),
    "out of reach": (
        ["compare", "--set=reference.path=circle", "--set=reference.path.radius_mm=900"],
        "cannot follow the path 'circle'",
    ),
    "no such law": (["run", "--law=magic"], "law must be one of open_loop, numerical_ik"),
    "empty law": (["run", "--law="], "law must be one of open_loop, numerical_ik"),
    "no cycle": (["compare", "--cycles=0"], "--cycles must be at least 1, got 0"),
    "no process": (["compare", "--jobs=0"], "--jobs must be at least 1, got 0"),
    "no pace": (["run", "--pace=0"], "--pace must be positive, got 0"),
    "folder is a file": (["compare", "--out=broken.yaml"], "broken.yaml"),
    "folder in a file": (["run", "--out=broken.yaml/out"], "cannot write in folder broken.yaml/out"),
    "json is a folder": (["compare", "--json=."], "it is a folder"),
    "json in a file": (["compare", "--json=broken.yaml/x.json"], "cannot write in folder broken.yaml"),
    "no picture": (["diagram", "--write=diagram.png"], "must be one of .svg, .dot"),
    "json without its suffix": (["compare", "--json=x"], "x: its name must end in .json"),
    "page without its suffix": (["zeros", "--report=x"], "x: its name must end in .html"),
    "table of a robot": (["calibrate", "--write=robot.csv"], "robot.csv: its name must end in .yaml or .yml"),
    "no depth": (["diagram", "--depth=0"], "--depth must be at least 1, got 0"),
}


@pytest.mark.parametrize(("arguments", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_bad_input_is_refused_in_one_line_before_anything_is_written(arguments, reason, tmp_path):
    (tmp_path / "broken.yaml").write_text("station: {camera: [")
    assert reason in refusal(truetip(*arguments))
    assert files(tmp_path) == {"broken.yaml"}


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_refused_before_anything_runs(tmp_path):
    (tmp_path / "closed").mkdir(mode=0o500)
    refused = refusal(truetip("compare", "--out=closed"))
    assert refused == "truetip: cannot write in folder closed: permission denied\n"


@pytest.mark.slow
def test_a_command_starts_without_what_few_need():
    """A refusal or a help text would wait a second for it, and so would every process of a comparison."""
    read = "from diagrams.scenario.scenario import load_scenario; load_scenario('everything')"
    slow = "{'numba', 'scipy.stats', 'scipy.signal', 'matplotlib', 'casadi'}"
    ask = f"import sys, experiments.running.compare_command; {read}; print({slow} & set(sys.modules))"
    folder = Path(main.__file__).parents[1]
    said = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True, cwd=folder)
    assert said.stdout.strip() == "set()"


@pytest.mark.slow
def test_a_comparison_gives_the_same_bytes_whatever_the_number_of_processes(tmp_path):
    shared = [*SHORT, "--cycles=2", "--laws=pbvs"]
    two = truetip("compare", *shared, "--jobs=2", "--out=a/b", "--json=copy.json")
    one = truetip("compare", *shared, "--jobs=1", "--out=c", "--json=-")
    assert (two.exit_code, one.exit_code) == (0, 0)
    summary = (tmp_path / "a/b/summary.json").read_text()
    assert (
        summary
        == (tmp_path / "copy.json").read_text()
        == (tmp_path / "c/summary.json").read_text()
        == one.stdout
    )
    assert files(tmp_path / "a/b") == files(tmp_path / "c") == RESULTS
    runs = json.loads(summary)["runs"]
    assert list(runs) == ["pbvs"]
    assert runs["pbvs"]["true"]["iso_9283"]["cycles"] == 2
    assert "PBVS" in two.stdout
    assert "PBVS" in one.stderr  # the table gives way to the JSON
    assert files(tmp_path) >= {"a", "c", "copy.json"}
    assert not [name for name in files(tmp_path) if "truetip-" in name]


@pytest.mark.slow
def test_another_seed_gives_other_numbers(tmp_path):
    for seed in (0, 1):
        assert truetip("run", *SHORT, f"--set=seed={seed}", f"--out={seed}").exit_code == 0
    numbers = [json.loads((tmp_path / f"{seed}/summary.json").read_text())["runs"] for seed in (0, 1)]
    assert numbers[0] != numbers[1]


def test_only_a_law_that_calibrates_can_write_a_robot(tmp_path):
    ended = truetip("run", "--law", "open_loop", "--write", tmp_path / "robot.yaml", "--out", tmp_path)
    assert "--write: needs one law that calibrates the robot" in refusal(ended)
    assert not files(tmp_path)


@pytest.mark.slow
def test_what_was_learnt_at_work_serves_a_law_without_a_camera(tmp_path):
    robot, numbers = tmp_path / "robot.yaml", []
    learning = "compare", "--quick", "--laws", "self_calibrating", "--scenario", "everything"
    assert truetip(*learning, "--write", robot, "--out", tmp_path).exit_code == 0
    for known in ([], ["--robot", robot]):
        blind = "compare", "--quick", "--laws", "open_loop", "--scenario", "everything"
        ended = truetip(*blind, *known, "--out", tmp_path, "--json=-")
        numbers.append(json.loads(ended.stdout)["runs"]["open_loop"]["true"]["max_norm_mm"])
    assert numbers[1] < 0.2 * numbers[0]  # what is left: nobody inverts springs and delays


@pytest.mark.slow
def test_quick_takes_one_cycle_of_a_faster_path_with_the_laws_that_one_compares_and_says_so(tmp_path):
    ended = truetip("compare", "--quick", *SHORT[:1], *SHORT[2:], "--json=-")
    assert ended.exit_code == 0
    result = json.loads(ended.stdout)
    assert "quick: one cycle, acceleration 2.8 1/s^2" in result["scenario"]
    assert "settling" not in result["scenario"].partition("quick")[2]  # was set explicitly
    assert list(result["runs"]) == ["open_loop", "numerical_ik", "pbvs", "position_level"]
    assert result["runs"]["pbvs"]["true"]["iso_9283"]["cycles"] == 1
    assert files(tmp_path / "out") == RESULTS
    assert "# misaligned (" in (tmp_path / "out/report.html").read_text()


@pytest.mark.slow
def test_a_run_reports_one_law_and_replaces_older_results_only(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/notes.txt").write_text("mine")
    (tmp_path / "out/summary.json").write_text("old")
    result = truetip("run", "--law=pbvs", *SHORT)
    assert result.exit_code == 0
    assert "PBVS" in result.stdout
    assert list(json.loads((tmp_path / "out/summary.json").read_text())["runs"]) == ["pbvs"]
    assert files(tmp_path / "out") == {*RESULTS, "notes.txt"}


def test_an_interrupted_comparison_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(compare_command, "compare", interrupted)
    result = truetip("compare", *SHORT)
    assert result.exit_code == 130
    assert result.stderr.strip() == "truetip: interrupted, nothing was written"
    assert files(tmp_path) == set()


def test_an_interruption_names_what_was_kept_all_the_same(tmp_path, monkeypatch):
    """As a record that is written while a robot moves, where Ctrl-C comes a second time."""

    def interrupted(*_):
        (tmp_path / "run.mcap").write_text("")
        stays(tmp_path / "run.mcap")
        stays(tmp_path / "not_begun.mcap")
        raise KeyboardInterrupt

    monkeypatch.setattr(compare_command, "compare", interrupted)
    result = truetip("compare", *SHORT)
    assert result.stderr.strip() == f"truetip: interrupted; kept: {tmp_path / 'run.mcap'}"


@pytest.mark.slow
def test_the_pace_of_a_run_can_be_set(tmp_path):
    assert truetip("run", "--law=open_loop", "--pace=1.5", *SHORT).exit_code == 0
    timing = json.loads((tmp_path / "out/timing.json").read_text())["runs"]["open_loop"]
    # Slower on a busy machine, but never faster than it was told.
    assert timing["real_time_factor"] < 1.5 * 1.05


@pytest.mark.slow
def test_a_run_can_be_watched_in_real_time(tmp_path, monkeypatch):
    monkeypatch.setattr(run_command, "_PATIENCE", 0.0)
    result = truetip("run", "--law=open_loop", "--live", *SHORT)
    assert result.exit_code == 0, result.output
    assert re.search(r"Watch it at http://localhost:\d+; it begins when the page is open", result.stdout)
    assert "Nobody has opened the page in 0 s" in result.stdout
    timing = json.loads((tmp_path / "out/timing.json").read_text())["runs"]["open_loop"]
    assert timing["real_time_factor"] < 1.05


@pytest.mark.slow
def test_what_the_readme_shows_can_be_run(tmp_path):
    readme = (Path(main.__file__).parents[1] / "README.md").read_text()
    # Of a robot file only one joint is shown.
    shown = [
        text for text in re.findall(r"^```yaml\n(.*?)^```", readme, re.M | re.S) if "joints:" not in text
    ]
    (tmp_path / "mine.yaml").write_text(shown[0])
    for number, text in enumerate(shown):
        (tmp_path / f"{number}.yaml").write_text(text)
        load_scenario(str(tmp_path / f"{number}.yaml"))
    commands = re.findall(r"^truetip (?:compare|run) .*", readme, re.M)
    assert "truetip compare --scenario mine.yaml" in commands
    for command in commands:
        words = command.split()
        settings = [value for option, value in pairwise(words) if option == "--set"]
        # The cell of the example is a file that another command writes.
        settings += [f"station.camera={value}" for option, value in pairwise(words) if option == "--camera"]
        settings = [setting.replace("=cell.yaml", "=probst") for setting in settings]
        name = "mine.yaml" if "--scenario" in words else "misaligned"
        check(prepare(name, settings), ["pbvs"])


def test_scenarios_and_robots_are_listed():
    scenarios, robots = truetip("scenarios"), truetip("robots")
    assert all(name in scenarios.stdout for name in shipped_scenarios())
    assert "Probst" in scenarios.stdout
    assert all(name in robots.stdout for name in shipped_robots())
    assert truetip("--version").stdout.startswith("truetip")


def test_a_model_of_what_the_robot_does_not_have_is_remarked():
    settings = ["servo.feedforward.kind=elastic_structure"]
    assert "station.elasticity=joints" in prepare("misaligned", settings).note
    assert not prepare("misaligned", [*settings, "station.elasticity=structure"]).note
    assert not prepare("misaligned").note
