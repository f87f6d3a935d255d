"""What a customer sees of a calibration: numbers rounded to what is known, in words."""

import json
from pathlib import Path

import numpy as np
import pytest

from experiments.calibration.words import icon, in_words, rounded
from robots.calibration.error_model import ErrorModel
from robots.calibration.measurement_file import measurement_text
from robots.calibration.measurements import SOURCE_NOISE, Measurements
from robots.description.joint_errors import KINDS
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from tests.experiments.commands import truetip
from tests.robots.programs.written import with_random_errors


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration from a noisy table with a gross error and a row that is none."""
    folder, robot, rng = tmp_path_factory.mktemp("page"), load_robot("irb1200"), np.random.default_rng(0)
    q = rng.uniform(0.9 * robot.lower, 0.9 * robot.upper, (75, 6))
    X = Kinematics(with_random_errors(robot, 2)).forward(q)
    table = Measurements(q, X[:, :3, 3], X[:, :3, :3]).noisy(SOURCE_NOISE, rng)
    table.position[5] += 0.02
    (folder / "m.csv").write_text(measurement_text(table) + "no,row\n")
    result = truetip(
        "calibrate", "--measurements", folder / "m.csv", "--out", folder, "--json", folder / "m.json"
    )
    assert result.exit_code == 0, result.output
    return folder


def test_json_says_what_was_left_out_and_what_is_left_of_every_row(folder: Path):
    found = json.loads((folder / "m.json").read_text())
    reasons = {(each["row"], each["why"].split(":")[0]) for each in found["left_out"]}
    assert reasons == {(7, "gross error"), (77, "q1_rad is not a finite number")}
    assert found["converged"] is True
    assert len(found["residuals"]) == 75
    assert [row["row"] for row in found["residuals"] if not row["used"]] == [7]
    size = len(found["names"])
    assert [len(found[key]) for key in ("values", "sigmas", "correlation")] == [size] * 3
    assert np.isfinite(found["condition"])


def test_the_page_names_parameters_and_shows_them_rounded(folder: Path):
    page = (folder / "report.html").read_text()
    found = json.loads((folder / "m.json").read_text())
    for name, value, sigma in zip(found["names"], found["values"], found["sigmas"], strict=True):
        factor = 1e3 if name.endswith(("_x", "_y", "_z")) else np.rad2deg(1.0)
        shown, _ = rounded(factor * value, 1.96 * factor * sigma)
        assert f"{in_words(name)}</td><td class=word>{name}</td>" in page
        assert f"<td>{shown}</td>" in page


@pytest.mark.parametrize(
    ("value", "uncertainty", "shown"),
    [
        (-1.23456, 0.0567, ("-1.235", "0.057")),
        (7.87426, 0.0971, ("7.874", "0.097")),
        (123.4, 4.56, ("123.4", "4.6")),
        (3.9876e-5, 1.2e-7, ("3.988e-05", "1.2e-07")),
        (0.00001, 0.5, ("0", "0.5")),
        (-0.001, 19.6, ("0", "20")),
    ],
)
def test_a_value_has_the_digits_that_its_uncertainty_leaves(value: float, uncertainty: float, shown: tuple):
    assert rounded(value, uncertainty) == shown


def test_every_parameter_has_words_of_its_own():
    names = ErrorModel(load_robot("irb1200"), tuple(KINDS)).names
    assert len({in_words(name) for name in (*names, "c_1", "c_6")}) == len(names) + 2
    assert in_words("joint3_rz") == "frame of joint 3, turn about z"


def test_targets_instruments_and_masses_have_words_whatever_their_names():
    assert in_words("target_left_ball_x") == "target left ball, shift along x"
    assert in_words("frame_tracker_rz") == "frame of instrument tracker, turn about z"
    assert in_words("centre_link_2_y") == "centre of mass link 2, shift along y"
    assert in_words("mass_payload") == "payload, mass"
    robot = load_robot("irb1200")
    assert icon("mass_link_1", robot) == ""
    assert "ellipse" in icon("frame_tracker_rz", robot)
    assert "polygon" in icon("anchor_bar_z", robot)
