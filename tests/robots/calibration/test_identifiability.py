"""Identifiable parameters: the source's table, the law of the combination, and what a poor set cannot see."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.calibration.identifiability import (
    Completeness,
    completeness,
    identifiable_parameters,
    unseen_parameters,
)
from robots.calibration.reduction import shown_by_errors
from robots.description.calibration import Calibration
from robots.description.error_parameters import NUM_PARAMETERS, error_parameters, parameter_names
from robots.description.model import Placement, RobotModel, load_robot
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.pose import pose_error

WITH_POSE = """
    p_q1 p_q2 p_q3 p_q4 p_q5 p_q6 pl_I0x pl_I0y pl_I0z pl_12x pl_12y pl_23z pl_34x pl_34z pl_45y pl_45z pl_56x
    pl_56z pl_6Ex pl_6Ey p_alpha0 p_beta0 p_alpha2 p_gamma2 p_alpha3 p_gamma3 p_gamma4 p_gamma5 p_beta_E
    p_gamma_E
""".split()  # noqa: SIM905, the names of the table as one reads them
UNSEEN_BY_POSITION = {"p_q6", "pl_56z", "p_gamma5", "p_beta_E", "p_gamma_E"}
POSITION_ONLY = [name for name in WITH_POSE if name not in UNSEEN_BY_POSITION]


def plain() -> RobotModel:
    return load_robot("irb1200")


def with_tool() -> RobotModel:
    robot = plain()
    robot.tool = Placement(np.array([0.03, -0.05, 0.21]), np.array([-75.0, 40.0, 12.0]))
    return robot


def skewed() -> RobotModel:
    """No two axes parallel, none meeting another: nothing but the own direction of each joint is lost."""
    robot, rng = with_tool(), np.random.default_rng(0)
    for joint in robot.joints:
        joint.placement = Placement(rng.normal(size=3) / 3.0, rng.uniform(-60.0, 60.0, 3))
    return robot


@pytest.mark.parametrize(("position_only", "expected"), [(False, WITH_POSE), (True, POSITION_ONLY)])
def test_the_independent_parameters_are_those_of_table_2_2(position_only: bool, expected: list[str]):
    found = identifiable_parameters(plain(), position_only)
    assert [found.names[i] for i in found.independent] == expected


def test_an_elbow_somewhat_beside_its_arm_has_the_same_parameters():
    """A hundredth of one here: an error across the arm is then one along it, too, and must not be lost."""
    robot = plain()
    placement = robot.joints[2].placement
    robot.joints[2].placement = replace(placement, translation=placement.translation + np.array([1e-5, 0, 0]))
    found = identifiable_parameters(robot)
    assert [found.names[i] for i in found.independent] == WITH_POSE
    assert found.explain()["pl_23x"]["pl_23z"] == pytest.approx(1e-5 / 0.35, rel=0.01)


def test_the_dependent_parameters_lie_where_table_2_2_and_its_errata_say():
    """Lengths of table 2.1: l_01z = 0.219, l_23z = 0.35, l_45x + l_56x by the wrist."""
    shares = identifiable_parameters(plain()).explain()
    assert shares["pl_01x"] == pytest.approx({"pl_I0x": 1.0})
    assert shares["p_beta1"] == pytest.approx({"pl_I0x": -0.219, "p_beta0": 1.0})
    assert shares["pl_23x"] == pytest.approx({"p_q2": 1.0 / 0.35, "p_q3": -1.0 / 0.35})
    assert shares["p_alpha5"] == pytest.approx({"p_q4": 1.0})
    assert shares["p_alpha6"] == pytest.approx({"pl_45y": 0.082, "p_gamma5": -1.0})
    without = identifiable_parameters(plain(), position_only=True).explain()
    assert without["pl_56z"] == pytest.approx({"p_q5": -1.0 / 0.082})
    assert without["p_gamma_E"] == {}  # it does not move the point


@pytest.mark.parametrize(
    ("robot", "pose", "position"),
    [(plain(), 30, 25), (with_tool(), 30, 27), (skewed(), 30, 27)],
    ids=["plain", "tool", "skewed"],
)
def test_ranks(robot: RobotModel, pose: int, position: int):
    """Four per axis and six for base and tool; a point leaves three, and on axis 6 two more, unseen."""
    assert identifiable_parameters(robot).rank == pose
    assert identifiable_parameters(robot, position_only=True).rank == position


@pytest.mark.parametrize("name", ["puma560", "tx2_90", "ur10"])
def test_a_column_of_rounding_is_no_parameter(name: str):
    """Their tool is on axis 6, which moves it by 1e-17 m: that shows in no measurement."""
    assert identifiable_parameters(load_robot(name), position_only=True).rank == 25


@pytest.mark.parametrize("robot", [plain(), with_tool(), skewed()], ids=["plain", "tool", "skewed"])
@pytest.mark.parametrize("position_only", [False, True])
def test_dependent_columns_are_combinations_of_independent_ones_everywhere(
    robot: RobotModel, position_only: bool
):
    found = identifiable_parameters(robot, position_only)
    q = np.random.default_rng(5).uniform(-3.0, 3.0, (50, 6))
    Theta = ErrorKinematics(robot).regressor(q, np.zeros(NUM_PARAMETERS))[:, 3 if position_only else 0 :]
    made = Theta[..., found.independent] @ found.combination
    np.testing.assert_allclose(Theta[..., found.dependent], made, atol=1e-10)


@pytest.mark.parametrize(("position_only", "rank"), [(False, 30), (True, 25)])
def test_the_48_parameters_are_complete_for_the_robot_of_the_source(position_only: bool, rank: int):
    found = completeness(plain(), position_only)
    assert (found.rank, found.covered, found.missed) == (rank, rank, ())
    assert f"span all {rank} directions" in found.sentence


@pytest.mark.parametrize("name", ["ur10", "puma560"])
def test_the_48_parameters_are_complete_where_frames_are_turned_about_their_axes(name: str):
    """The UR10 as its URDF draws it: two directions are missed with the turns of Probst (2024), 21 mm."""
    found = completeness(load_robot(name))
    assert (found.rank, found.covered, found.missed) == (30, 30, ())


@pytest.mark.slow
@settings(max_examples=25)
@given(st.integers(0, 10**6), st.booleans())
def test_the_48_parameters_are_complete_however_frames_were_drawn(seed: int, in_right_angles: bool):
    rng, robot = np.random.default_rng(seed), plain()
    joints = []
    for joint in robot.joints:
        turns = 90.0 * rng.integers(0, 4, 3) if in_right_angles else rng.uniform(-180.0, 180.0, 3)
        place = replace(joint.placement, translation=rng.uniform(-0.4, 0.4, 3), zyx_deg=turns.astype(float))
        joints.append(replace(joint, axis=np.eye(3)[rng.integers(3)], placement=place))
    assert completeness(replace(robot, joints=joints)).missed == ()


def test_what_would_be_missed_is_said():
    sentence = Completeness(30, 28, ("joint2_rz", "joint4_rz"), 21.0).sentence
    assert "span 28 of the 30 directions" in sentence
    assert "they would miss joint2_rz, joint4_rz, some 21.0 mm" in sentence


def test_base_parameters_move_the_tool_alike_to_first_order():
    robot, found = plain(), identifiable_parameters(plain())
    model, q = ErrorKinematics(robot), np.random.default_rng(3).uniform(-2.0, 2.0, (30, 6))
    p = np.random.default_rng(4).normal(size=NUM_PARAMETERS)
    gaps = [
        np.abs(pose_error(model.forward(q, size * p), model.forward(q, found.reduce(size * p)))).max()
        for size in (1e-3, 1e-4)
    ]
    assert gaps[1] < 0.02 * gaps[0]  # the difference is of second order


def test_a_set_of_configurations_that_moves_one_joint_only_names_what_it_cannot_see():
    robot = plain()
    found = identifiable_parameters(robot)
    names = [parameter_names(robot)[i] for i in found.independent]
    q = np.tile([0.0, 0.3, 0.2, 0.1, 0.5, 0.2], (40, 1))
    q[:, 5] = np.linspace(-3.0, 3.0, 40)
    Theta = ErrorKinematics(robot).regressor(q, np.zeros(NUM_PARAMETERS))[..., found.independent]
    unseen = unseen_parameters(Theta.reshape(-1, found.rank), names)
    assert {"p_q1", "p_q2", "p_q3"} <= set(unseen)
    assert "pl_6Ex" not in unseen  # turning joint 6 shows where the tool sits across its axis
    everywhere = ErrorKinematics(robot).regressor(
        np.random.default_rng(0).uniform(robot.lower, robot.upper, (40, 6)), np.zeros(NUM_PARAMETERS)
    )[..., found.independent]
    assert unseen_parameters(everywhere.reshape(-1, found.rank), names) == []


def test_the_units_of_the_parameters():
    units = [parameter.unit for parameter in error_parameters(plain())]
    assert units == ["rad"] * 6 + ["m"] * 24 + ["rad"] * 18


def test_a_calibrated_robot_has_no_parameters_of_its_own():
    robot = plain()
    robot.calibration = Calibration("irb1200", source="a measurement")
    with pytest.raises(ValueError, match="start from the nominal robot, irb1200"):
        identifiable_parameters(robot)


@pytest.mark.parametrize("robot", ["irb1200", "kr16", "ur10"])
def test_errors_bring_to_light_what_positions_of_a_tool_on_the_last_axis_hide(robot: str):
    """Its zero and its place; poses show as much of the robot as drawn."""
    assert shown_by_errors(load_robot(robot), position_only=True) == ["joint6_x", "joint6_rx"]
    assert shown_by_errors(load_robot(robot), position_only=False) == []
