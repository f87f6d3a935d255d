"""A scenario beside results names its files so that it is the same run from any folder."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagrams.scenario.kept import kept_text
from diagrams.scenario.scenario import load_scenario, scenario_text
from experiments.cli.prepare import prepare
from robots.description.calibration import Calibration
from robots.description.model import load_robot
from robots.description.robot_file import robot_text

LAW = """
from systems.servo.open_loop import OpenLoop
class Mine(OpenLoop):
    title = "Mine"
"""


def test_what_comes_with_truetip_keeps_its_name():
    scenario = load_scenario("everything-realistic")
    assert kept_text(scenario) == scenario_text(scenario)


@pytest.mark.parametrize(
    ("key", "name"),
    [
        ("robot", "arm.yaml"),
        ("servo.model.robot", "arm.yaml"),
        ("reference.path", "!Planned {file: motion.csv}"),
        ("station.camera", "!MarkerImages {calibration: cell.yaml}"),
        ("station.overview.surroundings", "things.yaml"),
        ("law", "laws.py:Mine"),
    ],
)
def test_files_are_found_from_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, name: str
):
    (tmp_path / "laws.py").write_text(LAW)
    for file in ("arm.yaml", "motion.csv", "cell.yaml", "things.yaml"):
        (tmp_path / file).write_text("")
    monkeypatch.chdir(tmp_path)
    text = kept_text(load_scenario("misaligned", [f"{key}={name}"]))
    file = next(word for word in name.rstrip("}").split() if "." in word)
    assert f" {tmp_path / file}\n" in text
    assert f" {file}\n" not in text


def test_gains_of_a_law_in_a_file_stay_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "laws.py").write_text(LAW)
    monkeypatch.chdir(tmp_path)
    setting = "servo.laws.laws.py:Mine.drive=cascade"
    (tmp_path / "kept.yaml").write_text(kept_text(load_scenario("misaligned", [setting])))
    monkeypatch.chdir("/")
    again = load_scenario(str(tmp_path / "kept.yaml"))
    assert again.servo.laws.own[f"{tmp_path}/laws.py:Mine"].plain == {"drive": "cascade"}


def test_a_calibrated_robot_of_an_option_is_what_the_controller_knows_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A run with --robot that was run again from its scenario.yaml had the drawing in its place."""
    nominal = load_robot("irb1200")
    tool = replace(nominal.tool, translation=nominal.tool.translation + 0.003)
    calibrated = replace(nominal, tool=tool, calibration=Calibration(of="irb1200"))
    (tmp_path / "robot.yaml").write_text(robot_text(calibrated))
    monkeypatch.chdir(tmp_path)
    first = prepare("misaligned", robot="robot.yaml")
    kept = first.kept
    (tmp_path / "kept.yaml").write_text(kept)
    monkeypatch.chdir("/")
    again = prepare(str(tmp_path / "kept.yaml"))
    np.testing.assert_array_equal(again.robot.tool.translation, first.robot.tool.translation)
    assert (again.kept, again.scenario.servo.model.robot) == (kept, "")
    np.testing.assert_array_equal(again.nominal_robot.tool.translation, nominal.tool.translation)
