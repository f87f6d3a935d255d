"""Tables of measurements: what was written is read, and what is wrong is said with its line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.calibration.measurement_file import (
    MeasurementFileError,
    measurement_text,
    parse_measurements,
    read_measurements,
)
from robots.calibration.measurements import Measurements
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics

ROBOT = load_robot("irb1200")
JOINTS = ",".join(f"q{n}_rad" for n in range(1, 7))


def table(count: int = 4, seed: int = 0) -> Measurements:
    q = np.random.default_rng(seed).uniform(ROBOT.lower, ROBOT.upper, (count, 6))
    X_WE = Kinematics(ROBOT).forward(q)
    return Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3], np.full(count, 3.5))


@pytest.mark.parametrize("with_rotation", [True, False])
def test_a_table_comes_back(with_rotation: bool):
    written = table() if with_rotation else table().without_rotation()
    read, problems = parse_measurements(measurement_text(written))
    assert problems == []
    np.testing.assert_array_equal(read.q, written.q)
    np.testing.assert_array_equal(read.position, written.position)
    np.testing.assert_array_equal(read.payload, written.payload)
    assert (read.rotation is None) == (written.rotation is None)
    np.testing.assert_allclose(read.X_WE, written.X_WE, atol=1e-15)
    np.testing.assert_array_equal(read.rows, [2, 3, 4, 5])


def test_units_separators_comments_and_other_columns_are_understood():
    text = """# from the cell
time_s;q1_deg;q2_deg;q3_deg;q4_deg;q5_deg;q6_deg;x_mm;y_mm;z_mm;alpha_deg;beta_deg;gamma_deg
0.1;90;-45;30;0;10;5;451.5;-3;620;90;0;0
"""
    read, problems = parse_measurements(text)
    assert problems == []
    np.testing.assert_allclose(read.q[0], np.deg2rad([90, -45, 30, 0, 10, 5]))
    np.testing.assert_allclose(read.position[0], [0.4515, -0.003, 0.62])
    assert read.rotation is not None
    np.testing.assert_allclose(read.rotation[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert read.rows[0] == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the table is empty"),
        (f"{JOINTS},x_m,y_m\n0,0,0,0,0,0,1,1", "column z_m or z_mm is missing; there are q1_rad"),
        (f"{JOINTS},x_m,y_m,z_m,qw,qx\n", "column qy is missing"),
        (f"{JOINTS},x_m,y_m,z_m\n", "no row but the header"),
        (f"{JOINTS},x_m,y_m,z_m\n0,45,0,0,0,0,0.5,0,0.5", r"line 2: q2_rad is 45, .* seems to hold degrees"),
        (f"{JOINTS},x_m,y_m,z_m\n0,0,0,0,0,0,500,0,0.5", r"line 2: x_m is 500, .* seems to hold millimetres"),
        (f"{JOINTS},x_m,y_m,z_m,x_m\n", "column x_m is there twice"),
        (f"{JOINTS},x_m,y_m,z_m\n0,0,0,0,0,0,0,5,0,0,5", "line 2: 11 fields, but the head has 9"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(text: str, message: str):
    with pytest.raises(MeasurementFileError, match=message):
        parse_measurements(text)


def test_bad_rows_are_named_and_the_others_used():
    lines = measurement_text(table(6)).splitlines()
    lines[2] = lines[2].replace(lines[2].split(",")[3], "nan", 1)  # line 3
    lines[3] = lines[3].rsplit(",", 3)[0]  # line 4: the end is missing
    cells = lines[4].split(",")
    cells[9] = "2.0"  # line 5: no unit quaternion
    lines[4] = ",".join(cells)
    lines.append(lines[1].rsplit(",", 1)[0] + ",-1")  # line 8: a load below nothing
    read, problems = parse_measurements("\n".join(lines))
    assert [problem.row for problem in problems] == [3, 4, 5, 8]
    assert [
        next(word for word in ("'nan'", "number: ''", "quaternion", "not be negative") if word in p.what)
        for p in problems
    ] == ["'nan'", "number: ''", "quaternion", "not be negative"]
    np.testing.assert_array_equal(read.rows, [2, 6, 7])


def test_a_configuration_may_be_measured_again():
    lines = measurement_text(replace(table(6), position=table(6).position + 1e-5)).splitlines()
    again = measurement_text(table(6)).splitlines()[1]
    read, problems = parse_measurements("\n".join([*lines, again]))
    assert problems == []
    np.testing.assert_array_equal(read.q[-1], read.q[0])


def test_a_table_pasted_twice_tells_no_more_than_once():
    """Intervals would be too small by the root of two."""
    lines = measurement_text(table(6)).splitlines()
    read, problems = parse_measurements("\n".join([*lines, *lines[1:]]))
    np.testing.assert_array_equal(read.q, table(6).q)
    assert [problem.row for problem in problems] == [8, 9, 10, 11, 12, 13]
    assert {problem.what for problem in problems} == {"a copy of an earlier line, not another measurement"}


def test_standard_deviations_of_rows_come_back_in_any_unit():
    told = replace(table(4), sigmas=np.outer([1.0, 2.0, 3.0, 4.0], [1e-4, 1e-5, np.nan]))
    text = measurement_text(told)
    assert text.splitlines()[0].endswith("payload_kg,sigma_joint_rad,sigma_position_m")
    np.testing.assert_array_equal(parse_measurements(text)[0].sigmas, told.sigmas)
    text = text.replace("sigma_position_m", "sigma_position_mm")
    np.testing.assert_allclose(parse_measurements(text)[0].sigmas[:, 1], 1e-3 * told.sigmas[:, 1])


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(MeasurementFileError, match=r"nothing\.csv: no such file"):
        read_measurements(tmp_path / "nothing.csv")


@pytest.mark.slow
@given(
    st.text(max_size=300)
    | st.lists(st.sampled_from([JOINTS, "x_m", "1", ",", ";", "\n", '"', "nan"])).map("".join)
)
@settings(max_examples=300, deadline=None)
def test_no_text_makes_the_reader_stumble(text: str):
    try:
        read, _ = parse_measurements(text)
    except MeasurementFileError:
        return
    assert len(read) > 0
