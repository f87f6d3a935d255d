"""Parts of drive trains in robot files: chosen by tags, read back, refused; robots on top of others."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from robots.description.drive_parts import (
    Backlash,
    Cubic,
    Dahl,
    Efficiency,
    FourierRatio,
    Limited,
    Polynomial,
    Sigmoid,
    StickSlip,
    Stribeck,
    Tanh,
    ViscoElastic,
)
from robots.description.model import RobotFileError, RobotModel, load_robot
from robots.description.robot_file import robot_text
from robots.description.variation import with_backlash

FRICTIONS = (
    Sigmoid(5.0, 2.0, 200.0),
    Tanh(5.0, 2.0, 0.01),
    Stribeck(5.0, 2.0, 200.0, 1.0, 0.02),
    Polynomial(2.0, 200.0, 0.05, 3.0, 5.0),
    StickSlip(5.0, 2.0, 3.0),
)


def robot_with_parts() -> RobotModel:
    """An IRB 1200 with one of each kind somewhere, joint 6 as it was."""
    robot = load_robot("irb1200")
    trains = [joint.drive_train for joint in robot.joints]
    for train, friction in zip(trains, FRICTIONS, strict=False):
        train.friction, train.motor_lag = friction, 3e-3
    trains[0].backlash, trains[0].stiffening = Backlash(0.5), Cubic(2e5)
    trains[1].backlash, trains[1].hysteresis = ViscoElastic(2e4, 1e4, 50.0), Dahl([0.1, 0.2], [5e-4, 2e-4])
    trains[2].ratio_error, trains[2].efficiency = FourierRatio([2e-5], [2.0], [30.0]), Efficiency(0.9, 0.8)
    trains[3].stiffening = Limited(2e5, 9e4, 1e-3)
    return robot


def test_a_robot_file_keeps_every_part(tmp_path: Path):
    text = robot_text(robot_with_parts())
    (tmp_path / "robot.yaml").write_text(text)
    read = load_robot(str(tmp_path / "robot.yaml"))
    assert robot_text(read) == text
    assert "friction: !Stribeck" in text
    assert [type(joint.drive_train.friction) for joint in read.joints[:5]] == [type(f) for f in FRICTIONS]


def test_the_trains_of_a_robot_have_the_parts_of_its_joints():
    trains: Any = robot_with_parts().drive_trains
    kept = trains.trains[5]
    robot = load_robot("irb1200")
    assert robot.drive_trains is None
    v = np.array([-0.5, 0.003, 2.0])
    joint = robot.joints[5].drive_train
    expected = joint.ratio**2 * joint.viscous_friction * v + joint.ratio * joint.coulomb_friction * np.tanh(
        v / joint.coulomb_velocity
    )
    np.testing.assert_allclose(sum(part.torque(v) for part in kept.frictions), expected)
    assert kept.spring.torque(np.array(1e-3)) == pytest.approx(45.0)
    hump = trains.trains[2].frictions[0].torque(np.array(0.02)) - 5.0 * 0.02 - 2.0 * np.tanh(2.0)
    assert hump == pytest.approx(1.0)  # N m
    error, _ = trains.trains[2].ratio.position_error(np.linspace(0.0, 0.2, 2001))
    assert abs(error).max() == pytest.approx(2e-5, rel=0.01)


@pytest.mark.parametrize(
    ("name", "part", "message"),
    [
        ("friction", StickSlip(0.0, 2.0, 1.0), "joint 3: .*breakaway must be at least coulomb"),
        ("friction", Stribeck(0.0, 1.0), "joint 3: Stribeck: hump and hump_velocity must be positive"),
        ("backlash", Backlash(-1.0), "joint 3: backlash: arc_minutes must not be negative"),
        ("hysteresis", Dahl([-0.1], [1e-4]), "joint 3: .*it would create energy"),
        ("efficiency", Efficiency(1.1), r"joint 3: .*forward must be in \(0, 1\], got 1.1"),
        ("ratio_error", FourierRatio([2e-5], [], []), "joint 3: .*equally many"),
        ("ratio_error", FourierRatio([0.02], [2.0], [0.0]), "joint 3: .*would turn back"),
        ("motor_lag", -1e-3, "joint 3: motor_lag must not be negative"),
    ],
)
def test_an_impossible_part_is_refused_in_one_line(tmp_path: Path, name: str, part, message: str):
    robot = load_robot("irb1200")
    setattr(robot.joints[2].drive_train, name, part)
    (tmp_path / "robot.yaml").write_text(robot_text(robot))
    with pytest.raises(RobotFileError, match=message) as refusal:
        load_robot(str(tmp_path / "robot.yaml"))
    assert "\n" not in str(refusal.value)


def test_a_part_that_does_not_exist_is_refused(tmp_path: Path):
    text = robot_text(robot_with_parts()).replace("!Stribeck", "!Rust")
    (tmp_path / "robot.yaml").write_text(text)
    with pytest.raises(RobotFileError, match="Rust"):
        load_robot(str(tmp_path / "robot.yaml"))


def test_a_file_that_extends_another_says_only_what_is_different(tmp_path: Path):
    (tmp_path / "base.yaml").write_text(robot_text(load_robot("irb1200")))
    joints = "\n".join(f"- drive_train: {{stiffness: {1000 * i}}}" for i in range(1, 7))
    (tmp_path / "mine.yaml").write_text(f"extends: base.yaml\nname: mine\njoints:\n{joints}\n")
    robot, base = load_robot(str(tmp_path / "mine.yaml")), load_robot("irb1200")
    np.testing.assert_allclose(robot.joint_stiffness, 1000.0 * np.arange(1, 7))
    np.testing.assert_array_equal(robot.gear_ratio, base.gear_ratio)
    assert robot.name == "mine"
    (tmp_path / "two.yaml").write_text("extends: base.yaml\njoints:\n- drive_train: {damping: 1}\n- {}\n")
    with pytest.raises(RobotFileError, match=r"two.yaml, line 3: joints must have 6 entries, got 2"):
        load_robot(str(tmp_path / "two.yaml"))
    (tmp_path / "base.yaml").write_text("extends: mine.yaml\n")
    with pytest.raises(RobotFileError, match="circle"):
        load_robot(str(tmp_path / "mine.yaml"))


@pytest.mark.parametrize("name", ["irb1200", "kr16", "kr210"])
def test_a_realistic_robot_is_the_base_with_softer_springs_and_every_part_assumed(name: str):
    base, robot = load_robot(name), load_robot(f"{name}-realistic")
    share = robot.joint_stiffness / base.joint_stiffness
    assert (share > 0.8).all()
    assert (share < 1.0).all()
    assert np.ptp(share) > 0.05
    assert {joint.drive_train.source for joint in robot.joints} == {"assumed"}
    v = np.array(1.0)
    for i, joint in enumerate(robot.joints):
        train, parts = joint.drive_train, cast(Any, joint.drive_train.parts())
        stock = float(base.joint_viscous_friction[i] + base.joint_coulomb_friction[i])
        assert float(sum(part.torque(v) for part in parts.frictions)) == pytest.approx(1.3 * stock, rel=0.01)
        assert parts.gap == pytest.approx(1.454e-4, rel=1e-3)  # 0.5'
        assert train.motor_lag == 3e-3
        assert parts.hysteresis.stiffness == (0.1 * train.stiffness,)


def test_other_gaps_leave_all_else_as_it_is():
    drawn = load_robot("irb1200-realistic")
    parts = [joint.drive_train.backlash for joint in with_backlash(drawn, 0.2).joints]
    assert parts == [
        Backlash(0.1, cast(Backlash, joint.drive_train.backlash).lubricant) for joint in drawn.joints
    ]
    assert robot_text(with_backlash(drawn, 1.0)) == robot_text(drawn)
    assert robot_text(with_backlash(load_robot("irb1200"), 0.2)) == robot_text(load_robot("irb1200"))
