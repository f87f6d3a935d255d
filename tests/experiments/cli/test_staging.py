"""Results appear all at once, or not at all."""

from pathlib import Path

import pytest

from experiments.cli.staging import PAGE, keep_files, staged_file, staged_folder
from experiments.cli.versions import versions_line
from experiments.comparison.results import replacing
from systems.vision.camera_rig import load_cell
from systems.vision.camera_rig_file import cell_text
from tests.experiments.commands import files, refusal, truetip


def test_files_appear_when_the_work_is_done_and_not_before(tmp_path: Path):
    with staged_folder(tmp_path / "new/results") as stage:
        (stage / "a.txt").write_text("a")
        assert not (tmp_path / "new").exists()
    assert files(tmp_path) == {"new", "new/results", "new/results/a.txt"}


def test_work_that_fails_leaves_older_results_as_they_were(tmp_path: Path):
    (tmp_path / "a.txt").write_text("old")

    def fail() -> None:
        with staged_folder(tmp_path) as stage:
            (stage / "a.txt").write_text("new")
            raise RuntimeError("defect")

    with pytest.raises(RuntimeError, match="defect"):
        fail()
    assert files(tmp_path) == {"a.txt"}
    assert (tmp_path / "a.txt").read_text() == "old"


def test_what_is_kept_of_work_that_fails_can_be_read_like_any_other_result(tmp_path: Path):
    (tmp_path / "ordinary").mkdir()

    def fail() -> None:
        with staged_folder(tmp_path / "results") as stage:
            (stage / "a.txt").write_text("a")
            keep_files(stage, tmp_path / "results")
            raise RuntimeError("the robot did not answer")

    with pytest.raises(RuntimeError, match="did not answer"):
        fail()
    assert files(tmp_path / "results") == {"a.txt"}
    assert (tmp_path / "results").stat().st_mode == (tmp_path / "ordinary").stat().st_mode


def test_a_file_whose_name_says_something_else_is_refused(tmp_path: Path):
    refused = pytest.raises(OSError, match=r"page.txt: its name must end in \.html or \.htm")
    with refused, staged_file(tmp_path / "page.txt", *PAGE):
        pytest.fail("the work began")
    with staged_file(tmp_path / "page.HTML", *PAGE) as path:
        path.write_text("")
    assert files(tmp_path) == {"page.HTML"}


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (["--json", "reslts/a.json"], "Made the folder reslts for --json reslts/a.json\n"),
        (["--json", "new/a.json", "--report", "new/a.html"], "Made the folder new for --json new/a.json\n"),
        (["--json", "old/a.json"], ""),
        (["--json", "a.json"], ""),
        ([], ""),  # the default of --report is in a folder that is made, too
    ],
)
def test_a_folder_that_is_made_for_a_file_is_named_as_it_may_be_a_slip(
    typed: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    Path("old").mkdir()
    result = truetip("modes", "--grid=2", *typed)
    assert result.exit_code == 0, result.output
    assert result.stderr == said


def test_a_file_is_replaced_whole(tmp_path: Path):
    (tmp_path / "a.txt").write_text("old")
    with staged_file(tmp_path / "a.txt") as path:
        path.write_text("new")
        assert (tmp_path / "a.txt").read_text() == "old"
    assert (tmp_path / "a.txt").read_text() == "new"
    assert files(tmp_path) == {"a.txt"}


def test_a_place_where_nothing_can_be_written_is_refused_before_the_work(tmp_path: Path):
    (tmp_path / "file").write_text("")
    refused = pytest.raises(OSError, match=r"cannot write in folder .*file/results: not a directory")
    with refused, staged_folder(tmp_path / "file/results"):
        pytest.fail("the work began")


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("modes --report r.html --animation ./r.html", "--report and --animation name the same file"),
        ("cameras calibrate --recording s.csv --write-recording s.csv", "--recording and --write-recording"),
        ("cameras calibrate --cell c.yaml --write sub/../c.yaml", "--cell and --write name the same file"),
        (
            "compensate m.mod --robot r.yaml --nominal irb1200 --with n.mod --write n.mod",
            "--write and --with",
        ),
        (
            "plan --path plan.mod --program rapid --report page.html",
            "--path plan.mod: the results in . would",
        ),
        (
            "identify --write-recording seen.csv --write seen.yaml",
            "--write seen.yaml: the results in . would",
        ),
        ("robots import r.yaml --write r.yaml", "FILE.urdf and --write name the same file"),
        ("run --law open_loop --scenario scenario.yaml --out .", "--scenario scenario.yaml: the"),
        ("compare --laws open_loop --scenario scenario.yaml --out .", "--scenario scenario.yaml: the"),
    ],
)
def test_what_is_written_is_named_by_one_option_alone(
    command: str, options: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.yaml").write_text(cell_text(load_cell("probst")))
    (tmp_path / "r.yaml").write_text("extends: irb1200\ncalibration: {of: irb1200, source: a table}\n")
    (tmp_path / "scenario.yaml").write_text("extends: misaligned\n")
    before = files(tmp_path)
    assert options in refusal(truetip(*command.split()))
    assert files(tmp_path) == before


def test_a_scenario_that_is_a_result_may_be_run_again_into_its_own_folder(tmp_path: Path):
    own = tmp_path / "scenario.yaml"
    own.write_text("extends: misaligned\n")
    assert "scenario.yaml" in replacing(tmp_path)
    own.write_text(f"# a run\n{versions_line()}\nextends: misaligned\n")
    assert "scenario.yaml" not in replacing(tmp_path)
    assert "report.html" in replacing(tmp_path)
