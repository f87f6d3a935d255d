"""``truetip cameras budget``: shares that sum up, a check by simulation, and late stamps that cost speed."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from diagrams.record.run_record import write_log
from experiments.cameras.budget import motion_of_record
from experiments.main import app
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from tests.experiments.synthetic import comparison


def budget(tmp_path: Path, *options: str) -> dict:
    arguments = ["cameras", "budget", "--report", str(tmp_path / "b.html"), "--json", "-", "--draws", "100"]
    result = CliRunner().invoke(app, [*arguments, *options])
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


@pytest.mark.slow
def test_the_shares_are_a_whole_and_late_stamps_take_over(tmp_path: Path):
    """With 100 draws the spread is known to 4 %, at five poses the worst of them to 12."""
    found = budget(tmp_path, "--time-ms", "1")
    assert sum(found["shares"].values()) == pytest.approx(1.0)
    assert found["simulated_deviation"] < 0.15
    # In the mean over the path, on which the tool is at rest at every corner.
    assert found["shares"]["time stamps"] == max(found["shares"].values()) > 0.4
    assert found["position_um"]["largest"] > 400.0  # 0.5 mm for a millisecond at half a metre per second
    assert "Along the path" in (tmp_path / "b.html").read_text()


EXACT = ["--pixel-sigma", "--camera-mm", "--camera-urad", "--tool-mm", "--temperature"]


@pytest.mark.slow
def test_where_nothing_is_uncertain_is_no_share_of_anything(tmp_path: Path):
    """Late stamps alone are no uncertainty at the corners, where the tool is at rest."""
    zeros = [word for option in EXACT for word in (option, "0")]
    found = budget(tmp_path, *zeros)
    assert found["shares"]["time stamps"] == pytest.approx(1.0)
    arguments = ["cameras", "budget", "--report", str(tmp_path / "c.html"), *zeros, "--time-ms", "0"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert "budget: nothing is uncertain that moves a position" in result.stderr
    assert not (tmp_path / "c.html").exists()


@pytest.mark.slow
def test_a_record_of_another_robot_is_refused(tmp_path: Path):
    (log,) = comparison(cycles=1, with_joints=True)["pbvs"]
    reached = Kinematics(load_robot("irb1200")).forward(log.joint_position)
    write_log(tmp_path / "run.mcap", "", replace(log, X_WE_desired=reached))
    assert len(motion_of_record(tmp_path / "run.mcap", 30, load_robot("irb1200")).time) == 30
    with pytest.raises(ValueError, match="mm off the path: it is of another robot"):
        motion_of_record(tmp_path / "run.mcap", 30, load_robot("kr16"))


def test_what_cannot_be_is_refused_in_one_line(tmp_path: Path):
    for option, value, message in (
        ("--pixel-sigma", "-1", "--pixel-sigma must be zero or positive, got -1"),
        ("--draws", "3", "--draws must be at least 100"),
        ("--recording", str(tmp_path / "none.mcap"), "no such file"),
    ):
        result = CliRunner().invoke(app, ["cameras", "budget", option, value])
        assert result.exit_code == 2
        assert message in result.stderr
        assert len(result.stderr.strip().splitlines()) == 1
