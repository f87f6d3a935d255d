"""Robot files: what the shipped one says, and how a bad one is refused."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import robots.description.model
from robots.description.model import RobotFileError, RobotModel, load_robot, shipped_robots

SHIPPED = Path(robots.description.model.__file__).parents[1] / "data" / "irb1200.yaml"


def sources(part: Any, where: str) -> dict[str, str]:
    """Every field named source, or ending in it, below a part."""
    if isinstance(part, list):
        below = [(f"{where}[{number}]", item) for number, item in enumerate(part, 1)]
    elif is_dataclass(part):
        below = [(f"{where}.{item.name}", getattr(part, item.name)) for item in fields(part)]
    else:
        return {where: part} if where.endswith("source") else {}
    return {name: text for child, item in below for name, text in sources(item, child).items()}


def edited(tmp_path: Path, change: Callable[[dict], Any]) -> str:
    """The path of a copy of the shipped file with a change."""
    robot = yaml.safe_load(SHIPPED.read_text())
    change(robot)
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump(robot))
    return str(path)


def put(*path: Any) -> Callable[[dict], None]:
    """A change that puts the last argument where the others lead."""
    *parents, key, value = path

    def change(robot: Any) -> None:
        for parent in parents:
            robot = robot[parent]
        robot[key] = value

    return change


@pytest.mark.parametrize("name", shipped_robots())
def test_every_part_of_a_shipped_robot_names_its_source(name: str):
    robot = load_robot(name)
    found = sources(robot, name)
    assert found.pop(f"{name}.calibration.source") == ""  # a robot as drawn
    assert bool(found.pop(f"{name}.measuring.source")) == bool(robot.measuring.lower_deg)
    of_joints = [part for joint in robot.joints for part in (joint.tilting, joint.drive_limits)]
    parts = [*of_joints, *(link.beam for link in robot.links), robot.counterbalance]
    optional = [part for part in parts if part is not None]
    # 6 joints with placement, limits, drive train; base, tool; 7 links with 3 each; payload with 2.
    assert len(found) == 6 * 3 + 2 + 7 * 3 + 2 + len(optional)
    assert not [where for where, source in found.items() if not source.strip()]


def test_arrays_are_in_si_units():
    robot = load_robot("irb1200")
    assert robot.lower == pytest.approx(np.deg2rad([-170, -100, -200, -270, -130, -400]))
    assert robot.upper == pytest.approx(np.deg2rad([170, 135, 70, 270, 130, 400]))
    assert robot.speed == pytest.approx(np.deg2rad([288, 240, 297, 400, 405, 600]))
    assert robot.axes == pytest.approx(
        np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    )


def test_motor_values_come_to_the_link_side_with_the_gear_ratio():
    """Torque grows with the ratio and speed falls by it: Probst (2024) eqs. (2.63), (2.64)."""
    robot = load_robot("irb1200")
    assert robot.joint_coulomb_friction[1] == pytest.approx(107.815 * 4.15e-3)
    assert robot.joint_viscous_friction[1] == pytest.approx(107.815**2 * 1.48e-3)
    assert robot.reflected_inertia[5] == pytest.approx(78.686**2 * 33.0e-6)


def test_axes_are_made_unit_vectors(tmp_path: Path):
    robot = load_robot(edited(tmp_path, put("joints", 1, "axis", [0, 3, 4])))
    assert robot.axes[1] == pytest.approx([0.0, 0.6, 0.8])


def test_a_file_is_found_by_its_path(tmp_path: Path):
    robot: RobotModel = load_robot(edited(tmp_path, put("name", "mine")))
    assert robot.name == "mine"


REFUSED = {
    "unknown key": (put("joints", 2, "drive_train", "stifness", 1.0), "stifness"),
    "five joints": (lambda robot: robot["joints"].pop(), "joints must have 6 entries, got 5"),
    "seven links": (lambda robot: robot["links"].append({}), "links must have 6 entries, got 7"),
    "crossed limits": (
        put("joints", 0, "limits", "lower_deg", 200),
        "joint 1: lower limit 200.0 deg is not below the upper 170.0 deg",
    ),
    "negative stiffness": (
        put("joints", 4, "drive_train", "stiffness", -2.0),
        "joint 5: stiffness must be positive, got -2.0",
    ),
    "negative damping": (
        put("joints", 4, "drive_train", "damping", -3.0),
        "joint 5: damping must not be negative, got -3.0",
    ),
    "number left out": (
        lambda robot: robot["joints"][2]["drive_train"].pop("stiffness"),
        "joint 3: stiffness must be positive, got 0.0",
    ),
    "word for a number": (put("joints", 1, "drive_train", "ratio", "high"), "'high'"),
    "not a number": (
        put("joints", 1, "drive_train", "damping", float("nan")),
        "joints[1].drive_train.damping must be finite, got nan",
    ),
    "two coordinates": (
        put("tool", "translation", [0, 1]),
        "tool.translation must be 3 numbers, got [0, 1]",
    ),
    "a tool in mm": (
        put("tool", "translation", [0, 0, 158]),
        "tool.translation[2] must be between -100 and 100 m, got 158",
    ),
    "a tool of some mm in mm": (
        put("tool", "translation", [0, 0, 8.5]),
        "tool.translation is 8.5 m long, more than 5 m; is it in m?",
    ),
    "axis without direction": (
        put("joints", 3, "axis", [0, 0, 0]),
        "joint 4: axis must have a direction, got [0.0, 0.0, 0.0]",
    ),
    "true for a number": (
        put("joints", 1, "drive_train", "ratio", True),
        "joints[1].drive_train.ratio must be a number, got true",
    ),
    "weightless link": (put("links", 5, "mass", 0), "links[5].mass must be positive, in kg, got 0"),
    "impossible inertia": (
        put("links", 0, "inertia", [1, 1, 3]),
        "link 1: inertia must be three positive moments",
    ),
    "negative payload": (
        put("payload", "largest_mass", -1),
        "payload.largest_mass must be zero or positive, in kg, got -1",
    ),
}


@pytest.mark.parametrize(("change", "message"), REFUSED.values(), ids=REFUSED)
def test_an_impossible_robot_is_refused_in_one_line(tmp_path: Path, change: Callable, message: str):
    path = edited(tmp_path, change)
    with pytest.raises(RobotFileError) as refused:
        load_robot(path)
    text = str(refused.value)
    assert text.startswith(f"robot file {path}")
    assert message in text
    assert "\n" not in text


def test_an_entry_of_an_extended_robot_may_stay_as_it_is_and_all_are_needed(tmp_path: Path):
    path = tmp_path / "robot.yaml"
    path.write_text("extends: kr16\njoints: [{drive_train: {stiffness: 1.0e+6}}, {}, {}, {}, {}, {}]\n")
    stiffness = [joint.drive_train.stiffness for joint in load_robot(str(path)).joints]
    assert stiffness == [1e6, *(joint.drive_train.stiffness for joint in load_robot("kr16").joints[1:])]
    path.write_text("extends: kr16\njoints:\n- {drive_train: {stiffness: 1.0e+6}}\n")
    with pytest.raises(RobotFileError, match=r"line 3: joints must have 6 entries, got 1; {} stands for one"):
        load_robot(str(path))


@pytest.mark.parametrize("content", ["joints: [1,\n  - 2", "just words", "", "- 1\n- 2"])
def test_a_file_that_is_no_mapping_in_yaml_is_refused_in_one_line(tmp_path: Path, content: str):
    path = tmp_path / "robot.yaml"
    path.write_text(content)
    with pytest.raises(RobotFileError) as refused:
        load_robot(str(path))
    assert str(refused.value).startswith(f"robot file {path}")
    assert "\n" not in str(refused.value)


def test_a_robot_file_may_be_named_in_capitals(tmp_path: Path):
    """As some systems do."""
    (tmp_path / "ARM.YAML").write_text("extends: irb1200\nname: mine\n")
    assert load_robot(str(tmp_path / "ARM.YAML")).name == "mine"


@pytest.mark.parametrize(
    ("name", "missing"),
    [
        ("irb9999", "no file of that name comes with truetip"),
        ("nowhere/robot.yaml", "no file nowhere/robot.yaml"),
    ],
)
def test_a_missing_robot_is_refused_with_the_names_of_those_there_are(name: str, missing: str):
    names = ", ".join(shipped_robots())
    with pytest.raises(RobotFileError, match=f"^robot '{name}': {missing}; give the path .* one of {names}$"):
        load_robot(name)
