"""truetip design and truetip calibrate as a person runs them."""

import json
from pathlib import Path

import numpy as np
import pytest

from experiments.calibration import calibrate_command
from robots.calibration.measurement_file import read_measurements
from robots.description.model import load_robot
from tests.experiments.browser import open_page
from tests.experiments.commands import files, refusal, truetip

SMALL = [
    "--set=station.elasticity=rigid",
    "--set=reference.settle=0.2",
    "--set=reference.dwell=1.5",
    "--set=reference.acceleration=3",
]
QUIET = ["--set", "station.camera.position_sigma=0", "--set", "station.camera.orientation_sigma_deg=0"]


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all that a calibration of a rigid robot without noise leaves, validated at few poses."""
    folder = tmp_path_factory.mktemp("calibration")
    options = ["--count", "20", "--out", str(folder), "--json", str(folder / "result.json")]
    files = ["--write", str(folder / "robot.yaml"), "--urdf", str(folder / "robot.urdf")]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibrate_command, "VALIDATION_COUNT", 10)
        result = truetip("calibrate", *SMALL, *QUIET, *options, *files)
    assert result.exit_code == 0, result.output
    return folder


@pytest.mark.slow
def test_a_design_is_written_with_its_bound_and_its_picture(tmp_path: Path):
    table, page = tmp_path / "design.csv", tmp_path / "design.html"
    result = truetip("design", "--count", "12", "--json", "-", "--write", str(table), "--report", str(page))
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert set(numbers) >= {"criterion", "count", "b3", "bound", "seconds", "peak_mb"}
    assert 0.9 * numbers["bound"] < numbers["b3"] <= numbers["bound"]
    q = np.loadtxt(table, delimiter=",", skiprows=1)
    robot = load_robot("irb1200")
    assert q.shape == (12, 6)
    assert (q >= robot.lower).all()
    assert (q <= robot.upper).all()
    assert "plotly" in page.read_text()


@pytest.mark.slow
def test_design_and_calibration_count_the_same_parameters_of_positions(tmp_path: Path):
    """A tool that is drawn on axis 6 says nothing of joint 6; one that is 10 mm beside it does."""
    design = truetip("design", "--position-only", "--count=12", f"--report={tmp_path / 'design.html'}")
    assert "It determines 25 parameters" in " ".join(design.output.split())
    assert "2 parameters more will: joint6_x, joint6_rx" in " ".join(design.output.split())
    options = ["--position-only", "--count=20", "--out", str(tmp_path)]
    result = truetip("calibrate", *SMALL, *QUIET, *options)
    assert "27 parameters (25 of the robot as drawn; joint6_x, joint6_rx show" in " ".join(
        result.output.split()
    )


def test_a_calibration_tells_what_it_is_worth(calibrated: Path):
    result = json.loads((calibrated / "result.json").read_text())
    assert result["identifiable"] == 30
    assert result["parameters"]["max_abs_error"] < 1e-5  # what still oscillates when it counts as rest
    assert (result["rank"], result["converged"]) == (30, True)
    assert len(result["names"]) == len(result["values"]) == len(result["sigmas"]) == 30
    assert np.shape(result["correlation"]) == (30, 30)
    assert result["condition"] > 1.0
    assert len(result["residuals"]) == 20
    validation = result["validation"]
    assert max(validation["before"]["mean_mm"]) > 10.0
    assert max(validation["after"]["max_mm"]) < 5e-3  # twice what still oscillates when it counts as rest
    assert max(validation["after_noise_free"]["max_mm"]) < 5e-3
    path = result["path"]
    assert max(path["after"]["static_mm"]) < 0.02 < 1.0 < max(path["before"]["static_mm"])
    assert result["design"]["b3"] <= result["design"]["bound"]


@pytest.mark.slow
def test_its_tables_serve_as_measurements_and_give_the_same_robot(calibrated: Path, tmp_path: Path):
    tables = [
        "--measurements",
        str(calibrated / "measurements.csv"),
        "--validation",
        str(calibrated / "validation.csv"),
    ]
    again = tmp_path / "again.yaml"
    result = truetip("calibrate", *tables, "--write", str(again), "--out", str(tmp_path), "--json", "-")
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert numbers["path"] is None
    assert max(numbers["validation"]["after"]["max_mm"]) < 5e-3
    one, two = load_robot(str(calibrated / "robot.yaml")), load_robot(str(again))
    for a, b in zip(one.joints, two.joints, strict=True):
        # The search stops at a thousandth of the noise, here of what still oscillates.
        np.testing.assert_allclose(a.placement.translation, b.placement.translation, atol=1e-9)


@pytest.mark.slow
def test_a_run_with_the_calibrated_robot_is_on_its_path_without_a_camera(calibrated: Path, tmp_path: Path):
    robot = str(calibrated / "robot.yaml")
    result = truetip("run", "--law", "open_loop", "--robot", robot, *SMALL, "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert max(summary["runs"]["open_loop"]["true"]["static_mm"]) < 0.02
    other = truetip("run", "--robot", robot, "--set", "robot=irb140", *SMALL, "--out", str(tmp_path))
    assert "was calibrated on 'irb1200', the scenario has 'irb140'" in refusal(other)


def test_bad_rows_are_named_and_do_no_harm(calibrated: Path, tmp_path: Path):
    lines = (calibrated / "measurements.csv").read_text().splitlines()
    lines[3] = lines[3].replace(lines[3].split(",")[6], "nan", 1)
    cells = lines[6].split(",")
    cells[6] = repr(float(cells[6]) + 1.0)  # a pose one metre off
    lines[6] = ",".join(cells)
    (tmp_path / "bad.csv").write_text("\n".join(lines))
    result = truetip(
        "calibrate", "--measurements", str(tmp_path / "bad.csv"), "--out", str(tmp_path), "--json", "-"
    )
    assert result.exit_code == 0, result.output
    assert "line 4: x_m is not a finite number" in " ".join(result.stderr.split())
    assert json.loads(result.stdout)["outliers"] == [7]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["design", "--count", "3"], "count must be between 5"),
        (["design", "--criterion", "x"], "criterion must be one of b3, d, i, got 'x'"),
        (["design", "--robot", "none"], "robot 'none': no file"),
        (
            ["design", "--camera-at", "here"],
            "--camera-at must be three numbers in m such as 1.5,0,1.2, up to 100 m, got",
        ),
        (["design", "--camera-at", "nan,0,1"], "--camera-at must be three numbers in m"),
        (["design", "--camera-at", "1500,0,1200"], "up to 100 m, got '1500,0,1200'"),
        (["design", "--box", "0,0,0,1,inf,1"], "--box must be six numbers in m"),
        (["design", "--range", "2=-4.5.5:90"], "--range must be like 2=-45:90"),
        (["design", "--range", "2=0:9", "--range", "2=0:90"], "--range of joint 2 is given twice"),
        (["design", "--anywhere", "--camera-at", "1,0,1"], "--camera-at has no effect with --anywhere"),
        (["design", "--anywhere", "--box", "0,0,0,1,1,1"], "--box has no effect with --anywhere"),
        (["design", "--anywhere", "--obstacles", "a.yaml"], "--obstacles has no effect with --anywhere"),
        (["calibrate", "--noise", "loud"], "--noise must be estimate, source or the path of a YAML file"),
        (["calibrate", "--measurements", "x.csv", "--count", "30"], "--count is for simulated measurements"),
        (["calibrate", "--validation", "x.csv"], "--validation needs --measurements"),
        (["calibrate", "--measurements", "none.csv"], "measurements none.csv: no such file"),
        (["calibrate", "--set", "station.kind=egm"], "calibrate does not drive a real station"),
        (["calibrate", "--count", "2"], "--count must be at least 5, got 2"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert message in refusal(truetip(*arguments))
    assert files(tmp_path) == set()  # nothing half-written


def test_measurements_that_hide_parameters_are_refused_by_name(calibrated: Path, tmp_path: Path):
    lines = (calibrated / "measurements.csv").read_text().splitlines()
    (tmp_path / "few.csv").write_text("\n".join(lines[:5]))
    result = truetip("calibrate", "--measurements", str(tmp_path / "few.csv"), "--out", str(tmp_path / "out"))
    assert "4 measurements do not determine" in refusal(result)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_page_of_a_calibration_opens_offline_without_errors(calibrated: Path):
    opened = open_page(calibrated / "report.html")
    # The three-dimensional picture draws advice on speed from the browser.
    advice = ("Canvas2D", "[.WebGL", "[GroupMarkerNotSet")
    assert not [line for line in opened.console if not line.startswith(advice)]
    assert opened.dom.count("js-plotly-plot") >= 3


def test_the_written_measurements_can_be_read_by_others(calibrated: Path):
    table, problems = read_measurements(calibrated / "measurements.csv")
    assert len(table) == 20
    assert problems == []
