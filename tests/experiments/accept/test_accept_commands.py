"""``truetip accept``: ball-bar lengths against a maximum, the ISO 9283 table, and what is refused."""

import json
from pathlib import Path

import pytest

from tests.experiments.commands import files, refusal, truetip


@pytest.mark.slow
def test_noise_of_pixels_decides_whether_cameras_pass(tmp_path: Path):
    def passed(sigma: float) -> dict:
        out = ["--report", tmp_path / "c.html", "--json", tmp_path / "c.json"]
        assert truetip("accept", "cameras", "--pixel-sigma", sigma, *out).exit_code == 0
        return json.loads((tmp_path / "c.json").read_text())

    quiet, loud = passed(0.02), passed(2.0)
    assert (quiet["lines"], quiet["lengths"]) == (7, 35)
    assert quiet["passed"]
    assert not loud["passed"]
    assert loud["probing_error_mm"] > 20.0 * quiet["probing_error_mm"]


def test_recorded_lengths_are_judged_by_the_largest_error(tmp_path: Path):
    rows = []
    for line in range(1, 8):
        for k in range(1, 6):
            error = 0.3 if (line, k) == (3, 4) else 0.05
            rows.append(f"{line},{200 * k},{200 * k + error}")
    table = tmp_path / "lengths.csv"
    table.write_text("\n".join(["line,nominal_mm,measured_mm", *rows]))
    result = truetip("accept", "cameras", "--lengths", table, "--report", tmp_path / "c.html", "--json", "-")
    numbers = json.loads(result.stdout)
    assert numbers["largest_length_error_mm"] == pytest.approx(0.3)
    assert (numbers["at_line"], numbers["at_length_mm"], numbers["passed"]) == (3, 800.0, False)
    table.write_text("\n".join(["line,nominal_mm,measured_mm", *rows[:30]]))
    assert "7 lines with 5 lengths each are needed, got 6 lines" in refusal(
        truetip("accept", "cameras", "--lengths", table, "--report", tmp_path / "d.html")
    )


def _lengths(line: int, k: int) -> list[float]:
    return [line, 200.0 * k, 200.0 * k + 0.05]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (
            lambda line, k: [line, 0.2 * k, 0.2 * k],
            "line 2: nominal_mm must be at least 20, got 0.2: is it in",
        ),
        (
            lambda line, k: [line, 200.0 * k, -200.0 * k],
            "line 2: measured_mm must be at least 20, got -200.0",
        ),
        (
            lambda line, k: [line + 0.5, *_lengths(line, k)[1:]],
            "line must be the number of a line, got '1.5'",
        ),
        (lambda line, k: _lengths(line, 1 + k % 2), "got 7 lines with 2 different ones at least"),
    ],
)
def test_a_table_that_is_none_of_lengths_is_refused(row, message: str, tmp_path: Path):
    table = tmp_path / "lengths.csv"
    rows = [",".join(map(str, row(line, k))) for line in range(1, 8) for k in range(1, 6)]
    table.write_text("\n".join(["line,nominal_mm,measured_mm", *rows]))
    out = tmp_path / "c.html"
    assert message in refusal(truetip("accept", "cameras", "--lengths", table, "--report", out))


def test_two_columns_of_one_name_are_refused(tmp_path: Path):
    table = tmp_path / "lengths.csv"
    table.write_text("line,nominal_mm,measured_mm,measured_mm\n1,200,200.1,205\n")
    out = tmp_path / "c.html"
    found = refusal(truetip("accept", "cameras", "--lengths", table, "--report", out))
    assert "lengths.csv, line 1: 2 columns 'measured_mm'; needed is one each of line, nominal_mm," in found


@pytest.mark.slow
def test_the_table_of_a_robot_has_a_column_for_each_speed(tmp_path: Path):
    result = truetip(
        "accept", "robot", "--scenario", "nominal", "--law", "open_loop", "--cycles", "2", "--dwell", "0.3",
        "--speeds", "100,50", "--set=station.elasticity=rigid", "--set=initial_error_mm=[0,0,0]",
        "--set=reference.acceleration=4", "--set=reference.settle=0.2", "--robot", "tx2_90",
        "--report", tmp_path / "r.html", "--json", tmp_path / "r.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "Note: carried over from ABB IRB 1200" in " ".join(result.stdout.split())
    fast, slow = json.loads((tmp_path / "r.json").read_text())["rows"]
    assert fast["AP_mm"] < 0.05  # a rigid robot without errors that follows its commands
    assert slow["AT_mm"] <= fast["AT_mm"]


@pytest.mark.slow
@pytest.mark.real_time
def test_a_guided_robot_is_judged_by_what_its_camera_measures(tmp_path: Path):
    """Over UDP against a virtual cell: numerical IK takes the tip to its poses, to the camera's noise."""
    result = truetip(
        "accept", "robot", "--with-cell", "--law", "numerical_ik", "--cycles", "2", "--dwell", "0.5",
        "--set=reference.acceleration=4", "--set=station.link.run.timeout=5",
        "--set=station.link.break_after=5", "--set=servo.guard.stop_after=5",
        "--report", tmp_path / "r.html", "--json", tmp_path / "r.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    (row,) = json.loads((tmp_path / "r.json").read_text())["rows"]
    assert row["AP_mm"] < 0.5  # the open loop is off by 20 mm
    assert row["AT_mm"] > row["AP_mm"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["robot", "--cycles", "1"], "--cycles must be at least 2, got 1"),
        (["robot", "--speeds", "fast"], "--speeds must be numbers such as 0,7, got 'fast'"),
        (["robot", "--loads", "-1"], "--loads must be between 0 and 1000, got -1"),
        (["robot", "--cube", "0.25"], "--cube must be at least 10 mm, got 0.25"),
        (["robot", "--with-cell", "--loads", "0,7"], "--loads is of a simulated station"),
        (["robot", "--with-cell", "--set", "station.link.has_camera=false"], "accept robot needs a camera"),
        (["robot", "--with-cell", "--scenario", "cell-watched"], "accept robot does not watch for people"),
        (["cameras", "--count", "4"], "--count must be at least 5, got 4"),
        (["cameras", "--cube", "0.5"], "--cube must be at least 10 mm, got 0.5"),
        (["cameras", "--cube", "1e5"], "a ball is not seen by two cameras"),
        (["cameras", "--lengths", "none.csv"], "none.csv"),
        (
            ["cameras", "--lengths", "l.csv", "--calibration", "c.yaml"],
            "--calibration has no effect with --lengths",
        ),
        (["cameras", "--lengths", "l.csv", "--seed", "0"], "--seed has no effect with --lengths"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert message in refusal(truetip("accept", *arguments))
    assert files(tmp_path) == set()
