"""A robot for a command: what its file says of where it is from."""

from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from experiments.cli.prepare import noted_robot, prepare
from robots.description.model import load_robot
from robots.description.robot_file import robot_text
from robots.description.source_notes import assumed_note
from tests.robots.urdfs import published


@pytest.mark.parametrize(
    ("name", "is_noted"), [("Our arm", True), ("Universal Robots UR10, calibrated", False)]
)
def test_a_copied_robot_file_is_named_and_a_calibrated_robot_is_not(
    tmp_path: Path, name: str, is_noted: bool
):
    file, console = tmp_path / "mine.yaml", Console(record=True, width=300)
    file.write_text(robot_text(replace(load_robot("ur10"), name=name)))
    assert noted_robot(console, str(file)).name == name
    said = f"sources in the file of {name} are those of another robot" in console.export_text()
    assert said == is_noted


@pytest.mark.slow
def test_it_is_said_what_the_controller_knows_of_another_robot():
    prepared = prepare("everything-realistic", robot="kr16-realistic")
    assert prepared.scenario.servo.model.robot == "kr16"
    assert prepared.note.endswith("the controller knows KUKA KR 16-2")
    assert "the controller knows" not in prepare("everything", robot="kr16").note


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "is_assumed"), [("crx10ial", True), ("kr16", False), (str(published("ur5_robot.urdf")), True)]
)
def test_a_robot_whose_springs_an_import_has_assumed_says_so_once_wherever_it_runs(
    name: str, is_assumed: bool
):
    console = Console(record=True, width=400)
    said = f"of {noted_robot(console, name).name} are assumed"
    for text in (console.export_text(), prepare("misaligned", robot=name).note):
        assert text.count(said) == is_assumed
        assert ("truetip identify" in text) == is_assumed


def test_springs_that_are_known_are_not_said_to_be_assumed():
    robot = load_robot("crx10ial")
    robot.joints[1].drive_train.source = "measured"
    assert assumed_note(robot) == ""
