"""``truetip accept tracker``: the camera that is wrong is named, and other tables are refused."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from diagrams.record.run_record import RunRecord
from diagrams.record.topics import JOINTS, POSE, pose_message
from experiments.main import app
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics


@pytest.fixture
def files(tmp_path):
    """A record whose camera errs by a wave of 0.2 mm, and what a tracker saw of the same motion."""
    time = np.arange(0.0, 8.0, 0.01)
    q = 0.3 * np.sin(np.outer(time, [0.9, 1.3, 0.7, 1.1, 1.7, 2.3])) + [0.0, 0.3, 0.2, 0.0, 0.8, 0.0]
    X = Kinematics(load_robot("irb1200")).forward(q)
    record = RunRecord(tmp_path / "run.mcap", "")
    wave = 2e-4 * np.column_stack([np.sin(5 * time), np.cos(6 * time), np.sin(4 * time)])
    for t, joints, pose, error in zip(time.tolist(), q, X, wave, strict=True):
        record.write(JOINTS, t, {"stamp": t, "position": joints.tolist(), "effort": [0.0] * 6})
        seen = pose.copy()
        seen[:3, 3] += error
        record.write(POSE, t, pose_message(seen, t))
    record.close()
    table = np.column_stack([time + 0.2, 1e3 * X[:, :3, 3][:, [1, 2, 0]] + 50.0])
    np.savetxt(tmp_path / "seen.csv", table, delimiter=";")
    return tmp_path / "run.mcap", tmp_path / "seen.csv"


def invoked(*arguments: object):
    return CliRunner().invoke(app, ["accept", "tracker", *map(str, arguments)])


def test_the_camera_that_is_wrong_is_named(files, tmp_path):
    result = invoked(*files, "--report", tmp_path / "t.html", "--json", "-")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["lag_s"] == pytest.approx(0.2, abs=1e-3)
    assert found["explained_by"] == "camera"
    assert found["rms_mm"] == pytest.approx(0.2 * np.sqrt(1.5), rel=0.15)
    assert "Along the motion" in (tmp_path / "t.html").read_text()


@pytest.mark.slow
def test_the_robot_is_that_of_the_record_and_refusals_say_of_what_they_are(tmp_path):
    time = np.arange(0.0, 8.0, 0.01)
    q = 0.3 * np.sin(np.outer(time, [0.9, 1.3, 0.7, 1.1, 1.7, 2.3])) + [0.0, -1.5, 1.7, 0.0, 0.8, 0.0]
    X = Kinematics(load_robot("kr16")).forward(q)
    record = RunRecord(tmp_path / "kr16.mcap", "robot: kr16\nreference:\n  path: !Circle {radius_mm: 100}\n")
    for t, joints, pose in zip(time.tolist(), q, X, strict=True):
        record.write(JOINTS, t, {"stamp": t, "position": joints.tolist(), "effort": [0.0] * 6})
        record.write(POSE, t, pose_message(pose, t))
    record.close()
    table = np.column_stack([time, 1e3 * X[:, :3, 3]])
    np.savetxt(tmp_path / "kr16.csv", table, delimiter=";")
    page = ["--report", tmp_path / "t.html"]
    result = invoked(tmp_path / "kr16.mcap", tmp_path / "kr16.csv", *page, "--json", "-")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["rms_mm"] < 1e-3
    result = invoked(tmp_path / "kr16.mcap", tmp_path / "kr16.csv", *page, "--robot", "irb1200")
    assert "camera and joints of" in result.stderr
    assert "kr16.mcap with --robot irb1200" in result.stderr
    result = invoked(tmp_path / "kr16.mcap", tmp_path / "kr16.csv", *page, "--unit", "m")
    assert "kr16.csv in m" in result.stderr


def test_what_cannot_be_compared_is_refused_in_one_line(files, tmp_path):
    record, seen = files
    (tmp_path / "three.csv").write_text("0 1 2\n1 2 3\n")
    lines = seen.read_text().splitlines()
    (tmp_path / "back.csv").write_text("\n".join([*lines[:300], lines[100], *lines[300:]]))
    fields = lines[300].split(";")
    far = ";".join([fields[0], "7e6", *fields[2:]])
    (tmp_path / "far.csv").write_text("\n".join(["time;x;y;z", *lines[:300], far, *lines[301:]]))
    for table, message in (
        ("far.csv", "far.csv, line 302: x is 7e+06 mm, and "),
        ("three.csv", "four numbers a line are needed, time and x, y, z, there are 3"),
        ("back.csv", "back.csv, line 301: the time does not rise"),
        ("none.csv", "none.csv: no such file"),
    ):
        result = invoked(record, tmp_path / table, "--report", tmp_path / "t.html")
        assert result.exit_code == 2
        assert message in result.stderr
        assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "t.html").exists()
