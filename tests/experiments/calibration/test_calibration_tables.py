"""truetip calibrate with tables of one's own: any robot, any instrument, and what is refused."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.calibration.report import noise_sentence, problem_lines, unexplained_sentence
from robots.calibration.identification import identify
from robots.calibration.instruments.observations import Observations
from robots.calibration.measurement_file import RowProblem, measurement_text
from robots.calibration.measurements import MeasurementNoise, Measurements
from robots.description.calibration import Calibration
from robots.description.model import load_robot
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.kinematics.forward import Kinematics
from tests.experiments.commands import refusal, truetip
from tests.robots.calibration.matrix_robot import MatrixRobot, homogeneous
from tests.robots.calibration.seen import PLACES, observed


def tables(folder: Path, name: str, position_only: bool = False) -> MatrixRobot:
    """Writes 60 and 20 rows of a robot that a tracker four metres away has seen without noise."""
    rng, drawn = np.random.default_rng(0), MatrixRobot(name)
    frame = homogeneous(Rotation.random(rng=rng), np.array([3.0, -2.0, 1.5]))
    true = drawn.displaced(rng).seen_from(frame)
    for file, count in (("measured.csv", 60), ("fresh.csv", 20)):
        q = drawn.configurations(count, rng)
        X_WE = true.forward(q)
        table = Measurements(q, X_WE[:, :3, 3], None if position_only else X_WE[:, :3, :3])
        (folder / file).write_text(measurement_text(table))
    return true


@pytest.mark.slow
@pytest.mark.parametrize(("name", "position_only"), [("ur10", False), ("puma560", True)])
def test_a_robot_without_analytic_inverse_is_calibrated_from_a_tracker(
    name: str, position_only: bool, tmp_path: Path
):
    true = tables(tmp_path, name, position_only)
    written, page = tmp_path / "robot.yaml", tmp_path / "out"
    arguments = ["--measurements", tmp_path / "measured.csv", "--validation", tmp_path / "fresh.csv"]
    result = truetip(
        "calibrate", "--robot", name, *arguments, "--write", written, "--out", page, "--json", "-"
    )
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert (found["rank"], found["converged"]) == (27 if position_only else 30, True)
    assert np.linalg.norm(found["frame"]["translation"]) == pytest.approx(3.9, rel=0.1)  # of (3, -2, 1.5)
    assert max(found["validation"]["after"]["max_mm"]) < 1e-9
    assert "in a frame of its own" in " ".join(result.stderr.split())
    q = MatrixRobot(name).configurations(50, np.random.default_rng(9))
    robot = load_robot(str(written))
    gap = (Kinematics(robot).forward(q) - true.forward(q))[:, :3, 3]
    assert np.abs(gap).max() < 1e-12
    assert robot.calibration.covariance_matrix.shape == (54, 54)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--count", "30"], "--count is for simulated measurements; with --measurements it has no effect"),
        (["--urdf-payload", "3"], "--urdf-payload needs --urdf"),
        (["--urdf", "x.urdf", "--urdf-payload", "3"], "--urdf-payload needs --compliance"),
        (["--noise", "none"], "--noise must be estimate, source or the path of a YAML file, got 'none'"),
        (["--noise", "noise.yaml"], "--noise noise.yaml, line 1: position_mm must be positive, in mm, got 0"),
        (["--noise", "place.yaml"], "--noise place.yaml: needs rotation_deg, as orientations are measured"),
        (["--validation", "empty.csv"], "measurements empty.csv: no row but the header"),
        (
            ["--validation", "targets.csv"],
            "targets.csv: a table of targets and instruments, and the",
        ),
        (
            ["--validation", "metres.csv"],
            "metres.csv: the calibrated robot does not predict fresh rows: half",
        ),
        (
            ["--validation", "turned.csv"],
            "turned.csv: the calibrated robot does not predict fresh rows: half",
        ),
        (["--validation", "heavy.csv"], "no usable row; payload_kg must not be negative, got -1"),
    ],
)
def test_what_does_not_go_together_is_said_in_one_line(
    options: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    tables(tmp_path, "irb1200")
    (tmp_path / "noise.yaml").write_text("{joint_deg: 0.1, position_mm: 0, rotation_deg: 0.1}")
    (tmp_path / "place.yaml").write_text("{joint_deg: 0.1, position_mm: 0.1}")
    header = (tmp_path / "fresh.csv").read_text().splitlines()[0]
    (tmp_path / "empty.csv").write_text(header)
    (tmp_path / "targets.csv").write_text(f"{header},target\n0,0,0,0,0,0,0,0,0,1,0,0,0,0,a")
    (tmp_path / "metres.csv").write_text((tmp_path / "fresh.csv").read_text().replace("_m,", "_mm,"))
    turned = (tmp_path / "fresh.csv").read_text().replace("qw,qx,qy,qz", "qx,qy,qz,qw")
    (tmp_path / "turned.csv").write_text(turned)
    (tmp_path / "heavy.csv").write_text(f"{header}\n0,0,0,0,0,0,0,0,0,1,0,0,0,-1")
    assert message in refusal(truetip("calibrate", "--measurements", "measured.csv", *options))
    assert not (tmp_path / "out").exists()


def test_loads_beyond_what_the_robot_carries_are_named(tmp_path: Path):
    """Grams for kilograms: geometry alone does not ask for them."""
    tables(tmp_path, "irb1200")
    table = tmp_path / "measured.csv"
    table.write_text(table.read_text().replace(",0.0\n", ",5000.0\n"))
    result = truetip("calibrate", "--measurements", table, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    said = "payload_kg, up to 5000 kg) have no effect on geometry alone; ABB IRB 1200-7/0.7 may carry 7 kg"
    assert said in " ".join(result.stdout.split())


def test_a_file_of_known_noise_is_believed(tmp_path: Path):
    tables(tmp_path, "irb1200")
    (tmp_path / "noise.yaml").write_text("{joint_deg: 0.01, position_mm: 0.1, rotation_deg: 0.05}")
    arguments = ["--measurements", tmp_path / "measured.csv", "--noise", tmp_path / "noise.yaml"]
    result = truetip("calibrate", *arguments, "--out", tmp_path / "out", "--json", "-")
    assert result.exit_code == 0, result.output
    known = {
        "estimated": False,
        "believed": False,
        "joint_deg": 0.01,
        "position_mm": 0.1,
        "rotation_deg": 0.05,
    }
    assert json.loads(result.stdout)["noise"] == pytest.approx(known)


@pytest.mark.slow
def test_who_measures_positions_need_not_know_how_well_they_turn(tmp_path: Path):
    tables(tmp_path, "irb1200")
    (tmp_path / "noise.yaml").write_text("{joint_deg: 0.01, position_mm: 0.1}")
    arguments = ["--measurements", tmp_path / "measured.csv", "--noise", tmp_path / "noise.yaml"]
    out = ["--out", tmp_path / "out", "--json", "-"]
    result = truetip("calibrate", *arguments, "--position-only", *out)
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert numbers["noise"]["position_mm"] == pytest.approx(0.1)
    assert numbers["rank"] == 27
    # Without fresh rows there is an error before and after all the same.
    assert "On its own rows the mean error falls" in (tmp_path / "out" / "report.html").read_text()


def write_lines(file: Path, seen: Observations, rows: range) -> None:
    """The lines of some configurations, with decimal commas."""
    head = [*(f"q{k}_rad" for k in range(1, 7)), "target", "instrument", "x_m", "y_m", "z_m", "distance_m"]
    lines = [";".join(head)]
    for k, row in enumerate(seen.row):
        if row not in rows:
            continue
        numbers = [*seen.q[row], *seen.position[k], seen.distance[k]]
        cells = ["" if np.isnan(value) else repr(float(value)).replace(".", ",") for value in numbers]
        names = [seen.targets[seen.target[k]], seen.instruments[seen.instrument[k]]]
        lines.append(";".join([*cells[:6], *names, *cells[6:]]))
    file.write_text("\n".join(lines))


def worst_step(robot: Path, true: MatrixRobot, q: np.ndarray, found: dict) -> float:
    """How wrong ways of target a between configurations are in m, wherever the world of the robot is."""
    X, X_true = Kinematics(load_robot(str(robot))).forward(q), true.forward(q)
    places = (1e-3 * np.array(found["targets_mm"]["a"]), PLACES["a"])
    p, p_true = (each[:, :3, :3] @ a + each[:, :3, 3] for each, a in zip((X, X_true), places, strict=True))
    steps, true_steps = (np.linalg.norm(np.diff(each, axis=0), axis=1) for each in (p, p_true))
    return float(np.abs(steps - true_steps).max())


@pytest.mark.slow
def test_a_table_of_targets_and_instruments_becomes_a_robot(tmp_path: Path):
    true, seen = observed(count=40)
    write_lines(tmp_path / "m.csv", seen, range(40))
    arguments = ["--measurements", tmp_path / "m.csv", "--robot", "irb1200"]
    result = truetip(
        "calibrate", *arguments, "--write", tmp_path / "r.yaml", "--out", tmp_path / "out", "--json", "-"
    )
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert set(found["frames"]) == {"tracker", "camera"}
    assert set(found["anchors_mm"]) == {"bar"}
    assert len(found["residuals"]) == len(seen)
    page = (tmp_path / "out" / "report.html").read_text()
    titles = (
        "Every line",
        "Errors in space",
        "What is left against the joints",
        "Is it noise?",
        "Correlation",
    )
    assert all(title in page for title in titles)
    assert "frame of instrument tracker, turn about z" in page
    assert np.isfinite(found["condition"])
    q = true.configurations(20, np.random.default_rng(5))
    assert worst_step(tmp_path / "r.yaml", true, q, found) < 1e-10
    refused = truetip("calibrate", *arguments, "--position-only", "--out", tmp_path / "no")
    assert "--position-only has no effect on a table of targets and instruments" in refusal(refused)


@pytest.mark.slow
def test_an_adjustment_is_validated_on_lines_of_its_own_and_written_as_urdf(tmp_path: Path):
    """Noise is known, one line of the fresh ones is bad, a redundant parameter stays zero."""
    true, seen = observed(count=60, noise=5e-5)
    seen.position[155] += 0.01
    write_lines(tmp_path / "m.csv", seen, range(40))
    write_lines(tmp_path / "v.csv", seen, range(40, 60))
    (tmp_path / "noise.yaml").write_text("{joint_deg: 0, position_mm: 0.05, rotation_deg: 1}")
    (tmp_path / "cell.yaml").write_text("sigma_mm: {camera: 0.25, bar: 0.005}")
    known = ["--noise", tmp_path / "noise.yaml", "--instruments", tmp_path / "cell.yaml", "--fixed", "zero_1"]
    tables = ["--measurements", tmp_path / "m.csv", "--validation", tmp_path / "v.csv"]
    written = ["--urdf", tmp_path / "r.urdf", "--out", tmp_path / "out", "--json", "-"]
    result = truetip("calibrate", *tables, *known, *written)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["noise"] == pytest.approx({"joint_deg": 0, "tracker": 0.05, "camera": 0.25, "bar": 0.005})
    assert "zero_1" not in found["names"]
    assert found["validation_outliers"] == [155 - int(np.sum(seen.row < 40)) + 2]  # the head is line 1
    before, after = found["validation"]["before"], found["validation"]["after"]
    assert all(before[name]["mean_mm"] > 5.0 for name in before)
    assert after["tracker"]["max_mm"] < 0.3  # three axes, and what 140 lines leave of the robot's errors
    assert "Validation" in (tmp_path / "out" / "report.html").read_text()
    q = true.configurations(20, np.random.default_rng(5))
    assert worst_step(tmp_path / "r.urdf", true, q, found) < 2e-4
    strange = (tmp_path / "v.csv").read_text().replace(";tracker;", ";other;")
    (tmp_path / "v.csv").write_text(strange)
    refused = truetip("calibrate", *tables, "--out", tmp_path / "no")
    assert "v.csv: instrument other is not in the calibration; there are camera, tracker, bar" in refusal(
        refused
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            "--measurements mine/measurements.csv --out mine",
            "--measurements mine/measurements.csv: the results",
        ),
        (
            "--measurements measured.csv --validation mine/validation.csv --out ./mine",
            "--validation mine/valid",
        ),
        ("--measurements measured.csv --robot my.yaml --write my.yaml", "is the nominal robot"),
        ("--measurements measured.csv --scenario cell.yaml --write ./my.yaml", "is the nominal robot"),
        ("--measurements measured.csv --noise noise.yaml --write noise.yaml", "--noise and --write name"),
    ],
)
def test_what_is_read_is_not_what_is_written(
    options: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    tables(tmp_path, "irb1200")
    (tmp_path / "mine").mkdir()
    shutil.copy("measured.csv", "mine/measurements.csv")
    shutil.copy("fresh.csv", "mine/validation.csv")
    (tmp_path / "my.yaml").write_text("extends: irb1200\n")
    (tmp_path / "cell.yaml").write_text("extends: misaligned\nrobot: my.yaml\n")
    (tmp_path / "noise.yaml").write_text("{joint_deg: 0.1, position_mm: 0.1, rotation_deg: 0.1}")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}
    assert message in refusal(truetip("calibrate", *options.split()))
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == before


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        (
            "anchors: {tracker: [0, 0, 0]}",
            "anchors.tracker: no line is of an instrument of distances tracker",
        ),
        ("frames: {bar: [0, 0, 0, 0, 0, 0]}", "frames.bar: no line is of an instrument of coordinates bar"),
        (
            "targets: {tracker: [0, 0, 0]}",
            "targets.tracker: no line is of a target tracker; there are a, b, c",
        ),
        ("sigma_mm: {a: 1}", "sigma_mm.a: no line is of an instrument a; there are bar, camera, tracker"),
    ],
)
def test_what_is_known_is_known_of_something_that_was_measured(
    cell: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    write_lines(tmp_path / "m.csv", observed(count=20)[1], range(20))
    (tmp_path / "cell.yaml").write_text(cell)
    result = truetip("calibrate", "--measurements", "m.csv", "--instruments", "cell.yaml")
    assert f"cell cell.yaml: {message}" in refusal(result)


def test_rows_with_the_same_fault_share_a_line():
    faults = [(2, "empty"), (4, "copy"), (5, "copy"), (6, "copy"), (9, "copy")]
    problems = [("m.csv", RowProblem(row, what)) for row, what in faults]
    assert problem_lines(problems) == [
        "m.csv, line 2: empty; left out",
        "m.csv, lines 4 to 6, 9: copy; left out",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["irb1200", "kr210"])
def test_springs_that_are_taken_for_noise_of_the_joints_are_asked_for(name: str):
    """Sag follows the weight and noise does not; on a long arm little noise of joints is as large."""
    robot, rng = load_robot(name), np.random.default_rng(3)
    q = MatrixRobot(name).configurations(60, rng)
    load = 0.4 * robot.payload.largest_mass
    soft = Calibration(compliance=(1.0 / robot.joint_stiffness).tolist())
    for yields, joint in ((soft, 0.0), (robot.calibration, 0.0), (robot.calibration, np.deg2rad(0.02))):
        X_WE = CompliantKinematics(replace(robot, calibration=yields), load).forward(q)
        table = Measurements(q, X_WE[:, :3, 3], None, np.full(60, load))
        found = identify(robot, table.noisy(MeasurementNoise(joint, 2e-5), rng))
        assert ("follow the weight" in unexplained_sentence(found)) == (yields is soft)


def test_noise_that_the_rows_do_not_have_is_printed_as_none():
    noise = MeasurementNoise(3e-24, 19e-6, np.deg2rad(0.002))
    found: Any = SimpleNamespace(
        noise=noise, noise_belief=None, is_noise_known=False, residuals=np.zeros((1, 6))
    )
    said = " Estimated noise: 0 degrees of the joints, 0.019 mm, 0.002 degrees."
    assert noise_sentence(found) == said
