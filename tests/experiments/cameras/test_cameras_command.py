"""truetip cameras: calibrations that can be repeated from files, studies, refusals in one line."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import Result

from experiments.cameras.sweeps import SWEEPS
from systems.vision.camera_rig import load_cell
from tests.experiments.browser import open_page
from tests.experiments.commands import SHORT, files, refusal, truetip


def run(*arguments: object) -> Result:
    return truetip("cameras", *arguments)


@pytest.mark.slow
def test_a_simulated_calibration_finds_the_cell_it_came_from(tmp_path: Path):
    result = run(
        "calibrate",
        "--places=300",
        f"--write={tmp_path / 'cell.yaml'}",
        f"--report={tmp_path / 'c.html'}",
        "--json=-",
    )
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert numbers["largest_error_over_standard_deviation"] < 4.0
    assert numbers["pixel_standard_deviation"] == pytest.approx(0.1, rel=0.05)
    assert numbers["wand_length_mean_mm"] == pytest.approx(601.7, abs=0.05)
    found, true = load_cell(str(tmp_path / "cell.yaml")), load_cell("probst")
    off = found.camera_model().p_WC - true.camera_model().p_WC
    assert np.linalg.norm(off, axis=1).max() < 0.01
    for camera, row in zip(found.cameras, numbers["cameras"], strict=True):
        assert row["position_mm"] == pytest.approx(camera.position_mm)


@pytest.mark.slow
def test_a_calibration_from_a_file_is_the_one_that_wrote_it(tmp_path: Path):
    table = tmp_path / "seen.csv"
    arguments = ("calibrate", f"--report={tmp_path / 'c.html'}", "--json=-")
    simulated = run(*arguments, "--places=200", f"--write-recording={table}")
    read = run(*arguments, f"--recording={table}")
    assert read.exit_code == 0, read.output
    one, other = json.loads(simulated.stdout), json.loads(read.stdout)
    for first, second in zip(one["cameras"], other["cameras"], strict=True):
        assert second["position_mm"] == pytest.approx(first["position_mm"], abs=0.01)
        assert second["average_residual_mm"] == pytest.approx(first["average_residual_mm"], rel=1e-3)
    assert other["largest_error_over_standard_deviation"] is None


@pytest.mark.slow
def test_a_wand_that_is_millimetres_wrong_is_told_by_the_frame(tmp_path: Path):
    seen = tmp_path / "seen.csv"
    right = run("calibrate", "--places=200", f"--write-recording={seen}", f"--out={tmp_path / 'a.html'}")
    assert "By the L-frame" not in right.stdout
    wrong = run("calibrate", f"--recording={seen}", "--wand-length=600", f"--out={tmp_path / 'b.html'}")
    said = " ".join(wrong.stdout.split())
    assert "By the L-frame the wand is 601.7" in said
    assert "and not 600: one of the two is wrong" in said
    assert "wrong by 2.8" in said


@pytest.mark.slow
def test_the_table_is_that_of_motion_capture(tmp_path: Path):
    result = run("calibrate", "--places=200", f"--report={tmp_path / 'c.html'}")
    assert result.exit_code == 0, result.output
    assert "wand's length has a standard deviation of 0." in " ".join(result.stdout.split())
    rows = [line.split() for line in result.stdout.splitlines() if line.startswith((" 0", " 1"))]
    assert [row[0] for row in rows] == [camera.name for camera in load_cell("probst").cameras]
    opened = open_page(tmp_path / "c.html")
    assert not [line for line in opened.console if "rror" in line]
    assert "js-plotly-plot" in opened.dom


HEAD = "exposure,camera,point,u_px,v_px\n"
REFUSED = {
    "file": ("calibrate", "--recording=nowhere.csv", "nowhere.csv: no such file"),
    "cell": ("calibrate", "--cell=nowhere", "cell 'nowhere': no file"),
    "places": ("calibrate", "--places=0", "places must be at least 1, got 0"),
    "few places": ("calibrate", "--places=3", "points of the wand, needs 30"),
    "length": ("calibrate", "--wand-length=0", "--wand-length must be at least 10 mm, got 0"),
    "noise": ("calibrate", "--pixel-sigma=-1", "--pixel-sigma must be positive, got -1"),
    "scenario": ("study", "--scenario=nowhere", "scenario 'nowhere'"),
    "jobs": ("study", "--jobs=0", "--jobs must be at least 1, got 0"),
    "light": ("study", "--set=station.markers.images.exposure=1e-5", "stay below the threshold"),
    "study cell": ("study", "--set=station.markers.cell=nowhere", "cell 'nowhere': no file"),
}


@pytest.mark.parametrize(("command", "option", "message"), REFUSED.values(), ids=REFUSED)
def test_wrong_input_is_refused_in_one_line_and_leaves_nothing(
    tmp_path: Path, command: str, option: str, message: str
):
    assert message in refusal(run(command, option, f"--report={tmp_path / 'page.html'}"))
    assert files(tmp_path) == set()


def test_a_wrong_line_of_a_table_is_named(tmp_path: Path):
    table = tmp_path / "seen.csv"
    table.write_text(HEAD + "1,01,A,2,3\n1,99,A,2,3\n")
    refused = refusal(run("calibrate", f"--recording={table}", f"--report={tmp_path / 'page.html'}"))
    assert "seen.csv, line 3: camera '99' is none of the cell" in refused


@pytest.mark.slow
def test_run_and_compare_take_another_camera(tmp_path: Path):
    options = [*SHORT, "--law=numerical_ik", f"--out={tmp_path}"]
    assert truetip("run", "--camera=features", *options).exit_code == 0
    by_features = json.loads((tmp_path / "summary.json").read_text())
    assert "station.camera.kind=features" in by_features["scenario"]
    assert truetip("run", *options).exit_code == 0
    by_pose = json.loads((tmp_path / "summary.json").read_text())
    measured = [run["runs"]["numerical_ik"]["measured"]["rms_norm_mm"] for run in (by_features, by_pose)]
    assert measured[0] != measured[1]
    refused = refusal(truetip("compare", "--camera=stereo", f"--out={tmp_path / 'nothing'}"))
    assert "station.camera must be one of pose, features, images, got 'stereo'" in refused


@pytest.mark.slow
def test_a_study_tells_of_every_sweep_and_law(tmp_path: Path):
    page, numbers = tmp_path / "study.html", tmp_path / "study.json"
    result = run(
        "study", "--quick", "--jobs=2", "--set=reference.path=circle", f"--report={page}", f"--json={numbers}"
    )
    assert result.exit_code == 0, result.output
    study = json.loads(numbers.read_text())
    assert list(study["sweeps"]) == list(SWEEPS)
    assert {row["camera"] for row in study["laws"]} == {"pose", "features", "images"}
    assert {row["law"] for row in study["laws"]} == {"numerical_ik", "pbvs", "position_level"}
    opened = open_page(page)
    assert not [line for line in opened.console if "rror" in line]
    assert "js-plotly-plot" in opened.dom
