"""``truetip health``: checks are appended, changes are named, and what cannot be continued is refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from diagrams.scenario.scenario import load_scenario
from experiments.health.history import new_history, read_history, write_history
from experiments.health.study import HealthStudy
from robots.description.model import load_robot
from systems.vision.camera_rig import load_cell
from systems.vision.camera_rig_file import cell_text
from tests.experiments.commands import files, refusal, truetip

STILL = ["--set=station.elasticity=rigid", "--set=initial_error_mm=[0,0,0]",
         "--set=station.camera.orientation_sigma_deg=0.01"]  # fmt: skip


def health(folder: Path, *more: str):
    options = ["--history", folder / "h.parquet", "--report", folder / "h.html", "--json", folder / "h.json"]
    result = truetip("health", *STILL, *options, *more)
    assert result.exit_code == 0, result.output
    return json.loads((folder / "h.json").read_text())


@pytest.mark.slow
def test_a_camera_that_turns_is_named_and_the_check_is_in_the_history(tmp_path: Path):
    (alarm,) = health(tmp_path, "--change", "camera:04:50")["alarms"]
    assert (alarm["kind"], alarm["what"]) == ("camera", "camera 04")
    assert alarm["onset_s"] == pytest.approx(1.0, abs=0.11)
    assert abs(alarm["size"] - 50e-6) < 4.0 * alarm["sigma"] + 5e-6
    assert pq.read_table(tmp_path / "h.parquet").num_rows == 1
    assert "camera 04 changed by" in (tmp_path / "h.html").read_text()


@pytest.mark.slow
def test_a_bent_arm_and_a_lost_sphere_are_named(tmp_path: Path):
    (bent,) = health(tmp_path, "--change", "marker:5:0.1")["alarms"]
    assert (bent["kind"], bent["what"]) == ("marker", "marker 5")
    assert abs(bent["size"] - 1e-4) < 5.0 * bent["sigma"]
    (tmp_path / "h.parquet").unlink()
    (lost,) = health(tmp_path, "--change", "marker:7:lost")["alarms"]
    assert lost["what"] == "marker 7 (not seen)"
    assert "marker 7 (not seen) since day 0" in (tmp_path / "h.html").read_text()


@pytest.mark.slow
def test_a_history_goes_on_and_a_joint_that_drifts_is_named(tmp_path: Path):
    assert health(tmp_path, "--checks", "2")["alarms"] == []
    worn = health(tmp_path, "--change", "joint:3:40", "--checks", "2")
    (alarm,) = worn["alarms"]
    assert (alarm["kind"], alarm["what"], alarm["onset_s"]) == ("joint zero", "joint 3", 2 * 86400.0)
    assert pq.read_table(tmp_path / "h.parquet").num_rows == worn["checks"] == 4


@pytest.mark.slow
def test_without_a_history_a_joint_drifts_behind_the_first_check(tmp_path: Path):
    """It had drifted before the first check, with which all others are compared, and nothing showed."""
    (alarm,) = health(tmp_path, "--change", "joint:3:40", "--checks", "2")["alarms"]
    assert (alarm["what"], alarm["onset_s"]) == ("joint 3", 86400.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--checks", "0"], "--checks must be at least 1, got 0"),
        (["--change", "joint:1"], "--change must be joint:N:MDEG, tool:MM, camera:NAME:MICRORADIANS"),
        (["--change", "joint:7:1"], "--change joint:7:1: the joints are 1 to 6, got '7'"),
        (["--change", "camera:99:1"], "the cameras are 01, 02"),
        (["--change", "marker:5:nan"], "--change marker:5:nan: the size must be a finite number, got 'nan'"),
        (["--change", "joint:3:inf"], "--change joint:3:inf: the size must be a finite number, got 'inf'"),
        (["--change-at", "2"], "--change-at needs --change"),
        (["--change", "joint:3:40"], "joints and tool are held against the first check"),
        (
            ["--change", "tool:0.2", "--change-at", "1", "--checks", "3"],
            "--change-at must be at least 2, got 1",
        ),
        (["--change", "joint:3:40", "--change-at", "2"], "--change-at 2: the last check of this run is 1"),
        (["--with-cell", "--change", "joint:3:40"], "--change changes a simulated station"),
        (
            ["--with-cell", "--checks", "2"],
            "--checks is of a simulated station, this one is checked once, got 2",
        ),
        (["--with-cell", "--set", "station.link.has_camera=false"], "health needs a camera"),
        (["--with-cell", "--scenario", "cell-watched"], "health does not watch for people"),
        (["--with-cell", "--station", "rsi", "--checks", "2"], "this one is checked once, got 2"),
        (["--history", "h.csv"], "h.csv"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert message in refusal(truetip("health", *STILL, *arguments))
    assert files(tmp_path) == set()


@pytest.mark.slow
@pytest.mark.real_time
def test_a_joint_of_a_guided_robot_that_drifts_is_named_and_its_history_is_not_one_of_simulations(
    tmp_path: Path,
):
    """The virtual cell stands for hardware; its joint 3 is off by 40 mdeg from the second check on."""
    patient = ["station.link.run.timeout=5", "station.link.break_after=5"]
    guided = ["--with-cell", *(f"--set={setting}" for setting in patient)]
    assert health(tmp_path, *guided)["alarms"] == []
    page = (tmp_path / "h.html").read_text()
    assert "Zeros of the joints" in page
    assert "By how much they have turned" not in page
    offset = load_scenario("cell").station.errors.joint_offset_deg + np.array([0, 0, 0.04, 0, 0, 0])
    (alarm,) = health(tmp_path, *guided, f"--set=station.errors.joint_offset_deg={offset.tolist()}")["alarms"]
    assert (alarm["kind"], alarm["what"]) == ("joint zero", "joint 3")
    assert abs(np.rad2deg(alarm["size"])) == pytest.approx(0.04, abs=5e-3)
    assert 0.0 < alarm["onset_s"] < 86400.0
    told = refusal(truetip("health", *STILL, "--history", tmp_path / "h.parquet"))
    assert "simulated checks cannot be continued on a station, nor the other way round" in told


@pytest.mark.slow
def test_a_history_is_that_of_the_cameras_and_not_of_their_names(tmp_path: Path):
    scenario, robot = load_scenario("nominal"), load_robot("irb1200")
    path = tmp_path / "h.parquet"
    study = HealthStudy(scenario, robot)
    cameras = np.zeros((len(study.names), 3))
    write_history(path, study.begun().appended(0.0, np.tile(np.eye(4), (6, 1, 1)), cameras, []))
    study.refuse(read_history(path), is_simulated=True)
    rig = load_cell("probst")
    rig.cameras[3].position_mm = rig.cameras[3].position_mm + np.array([5.0, 0.0, 0.0])
    (tmp_path / "moved.yaml").write_text(cell_text(rig))
    moved = HealthStudy(scenario, robot, str(tmp_path / "moved.yaml"))
    with pytest.raises(ValueError, match=r"cameras of these names that stand elsewhere .*: 04; begin"):
        moved.refuse(read_history(path), is_simulated=True)
    # One from before cameras were kept goes on.
    moved.refuse(replace(read_history(path), calibration=None), is_simulated=True)


def of_one_check(path: Path) -> Path:
    nothing = new_history("irb1200", ("01", "02"), np.zeros((6, 6)), np.zeros((2, 9)))
    write_history(path, nothing.appended(0.0, np.tile(np.eye(4), (6, 1, 1)), np.zeros((2, 3)), []))
    return path


@pytest.mark.parametrize("kept", [0, 3, 2000, -10])
def test_a_history_that_was_cut_off_is_told_so(tmp_path: Path, kept: int):
    path = of_one_check(tmp_path / "h.parquet")
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(ValueError, match=r"h.parquet: the file is cut off .*: put a copy in its place, or"):
        read_history(path)


def test_a_history_with_other_bytes_within_is_told_to_be_damaged(tmp_path: Path):
    path = of_one_check(tmp_path / "h.parquet")
    whole = path.read_bytes()
    path.write_bytes(whole[:100] + bytes(300) + whole[400:])
    with pytest.raises(ValueError, match=r"h.parquet: the file is damaged: put a copy in its place, or"):
        read_history(path)


@pytest.mark.slow
def test_a_file_that_is_no_history_is_refused_and_stays(tmp_path: Path):
    path = tmp_path / "h.parquet"
    path.write_text("something else")
    assert "not a history of truetip health" in refusal(truetip("health", *STILL, "--history", path))
    assert path.read_text() == "something else"
