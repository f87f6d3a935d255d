"""``truetip record``: goes on where it was interrupted, and refuses what it could not continue."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from diagrams.record.run_record import RunRecord
from diagrams.record.topics import JOINTS, POSE, pose_message
from experiments.cli.workers import SimulationError
from experiments.main import app
from experiments.station import record_command
from experiments.station.measured_table import MeasuredTable, read_configurations
from robots.calibration.measurement_file import read_measurements

Q = np.deg2rad([[0, 20, 10, 0, 40, 0], [15, 10, 0, 20, 30, 10], [-20, 30, 15, -10, 50, 40]])
HEAD = ",".join(f"q{number}_deg" for number in range(1, 7))


def refused(*arguments: str) -> str:
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1
    return result.stderr


@pytest.fixture
def design(tmp_path):
    path = tmp_path / "design.csv"
    rows = [",".join(map(repr, row)) for row in np.rad2deg(Q).tolist()]
    path.write_text("\n".join([HEAD, *rows]) + "\n")
    return path


def test_every_row_is_on_the_disk_at_once_and_the_next_run_knows_it(tmp_path, design):
    path = tmp_path / "measured.csv"
    q = read_configurations(design)
    np.testing.assert_allclose(q, Q, atol=1e-12)
    table = MeasuredTable(path, q, 2.0)
    for number in (3, 1):
        table.append(number, (q[number - 1] + 1e-4, np.array([0.5, 0.1, 0.2 * number]), np.eye(3)))
    found, problems = read_measurements(path)
    assert not problems
    np.testing.assert_array_equal(found.position[:, 2], [0.2 * 3, 0.2])
    assert MeasuredTable(path, q, 2.0).measured == {1, 3}
    with pytest.raises(ValueError, match="line 2: measured at another configuration or load"):
        MeasuredTable(path, q, 3.0)
    with pytest.raises(ValueError, match="line 3: measured at another configuration or load"):
        MeasuredTable(path, q[1:], 2.0)


def test_a_configuration_that_the_design_visits_twice_is_measured_twice(tmp_path):
    path, q = tmp_path / "measured.csv", Q[[0, 1, 0]]
    table = MeasuredTable(path, q, 2.0)
    for number, known in ((1, {1}), (2, {1, 2}), (3, {1, 2, 3})):
        table.append(number, (q[number - 1] + 1e-4, np.array([0.5, 0.1, 0.1 * number]), np.eye(3)))
        assert MeasuredTable(path, q, 2.0).measured == known


def test_what_cannot_be_measured_is_refused_in_one_line(tmp_path, design):
    assert "2 or more exposures, got 0.5 s, 0.0 s" in refused("record", str(design), "--mean", "0")
    assert "must be between 0 and 1, got 2.0" in refused("record", str(design), "--speed", "2")
    assert "must end in .csv or .txt" in refused("record", str(design), "--write", str(tmp_path / "a.mcap"))
    assert "nothing.csv: no such file" in refused("record", str(tmp_path / "nothing.csv"))
    design.write_text(HEAD + "\n1,2,3,4,5,six\n")
    assert "design.csv, line 2: not six finite joint positions" in refused("record", str(design))
    design.write_text(f"q1_deg,{HEAD}\n0,1,2,3,4,5,6\n")
    assert "design.csv: column q1_deg is there twice" in refused("record", str(design))
    design.write_text(HEAD + "\n0,20,10,0,40,0\n0,300,0,0,0,0\n")
    assert "ways: 0.0, 300.0, 0.0, 0.0, 0.0, 0.0 degrees is beyond a limit" in refused(
        "record", str(design), "--with-cell", "--write", str(tmp_path / "a.csv")
    )
    design.write_text(HEAD + "\n1,5,2,0,3,0,4,0,5,0,6,0\n")  # decimal commas between commas
    assert "design.csv, line 2: 12 fields, but the head has 6" in refused("record", str(design))


def test_the_numbers_of_a_run_are_written(tmp_path, design, monkeypatch: pytest.MonkeyPatch):
    def measured(prepared, run, route, table, options):
        table.measured |= {1, 2, 3}
        return [2], "design", 0

    monkeypatch.setattr(record_command, "_recorded", measured)
    numbers, table = tmp_path / "run.json", tmp_path / "measured.csv"
    options = ["--with-cell", "--write", str(table), "--json", str(numbers)]
    result = CliRunner().invoke(app, ["record", str(design), *options], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert json.loads(numbers.read_text()) == {
        "configurations": 3, "measured": 3, "not_seen": [2], "ended": "design", "file": str(table)
    }  # fmt: skip


def test_a_controller_that_stops_leaves_what_was_measured_and_said(
    tmp_path, design, monkeypatch: pytest.MonkeyPatch
):
    """The next part of the run has a recording of its own; the first one was replaced by it."""
    table, said = tmp_path / "measured.csv", tmp_path / "said.mcap"
    parts: list[str] = []

    def broken(prepared, run, route, rows, options):
        rows.append(len(rows.measured) + 1, (Q[len(rows.measured)], np.array([0.5, 0.1, 0.2]), np.eye(3)))
        parts.append(options[1].name)
        options[1].write_text("")
        raise SimulationError("the controller stopped on the way to the goal")

    monkeypatch.setattr(record_command, "_recorded", broken)
    command = ["record", str(design), "--with-cell", "--write", str(table), "--write-recording", str(said)]
    for number in (1, 2):
        result = CliRunner().invoke(app, command, catch_exceptions=False)
        assert result.exit_code == 1
        assert f"{number} configuration{'s' if number > 1 else ''} of 3 measured" in result.stdout
        assert result.stderr.strip() == (
            "truetip: the controller stopped on the way to the goal; the same command goes on from here"
        )
    assert parts == ["said.mcap", "said-2.mcap"]


def test_a_run_that_measures_nothing_leaves_no_folder(tmp_path, design, monkeypatch: pytest.MonkeyPatch):
    def silent(*_):
        raise SimulationError("no message of a controller came in")

    monkeypatch.setattr(record_command, "_recorded", silent)
    table = tmp_path / "new" / "folder" / "measured.csv"
    result = CliRunner().invoke(app, ["record", str(design), "--with-cell", "--write", str(table)])
    assert (result.exit_code, result.stderr) == (1, "truetip: no message of a controller came in\n")
    assert not (tmp_path / "new").exists()


def test_a_recording_without_a_dwell_is_refused_in_one_line(tmp_path):
    path = tmp_path / "moving.mcap"
    # A path has a tag, which a reader of plain YAML refuses.
    record = RunRecord(path, "reference:\n  path: !Circle {radius_mm: 150}\nstation: {payload: 1.0}\n")
    for at in np.arange(0.0, 4.0, 0.02).tolist():
        record.write(JOINTS, at, {"stamp": at, "position": [0.1 * at] * 6, "effort": [0.0] * 6})
        record.write(POSE, at, pose_message(np.eye(4), at))
    record.close()
    out = ["--out", str(tmp_path / "calibration")]
    assert "moving.mcap: the robot nowhere rests for 1.5 s" in refused(
        "calibrate", "--recording", str(path), *out
    )
    both = ["--recording", str(path), "--measurements", str(path)]
    assert "one of them is the calibration set" in refused("calibrate", *both)
    assert not (tmp_path / "calibration").exists()
