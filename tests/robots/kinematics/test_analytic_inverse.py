"""Analytic inverse kinematics: round trips with the forward kinematics, turns, limits, reach, structure."""

from collections.abc import Callable
from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.description.model import Placement, RobotModel, load_robot
from robots.kinematics.analytic_inverse import InverseKinematics, JointLimitError, UnreachableError
from robots.kinematics.forward import Kinematics
from robots.pose import wrap_angle

ROUNDING = 1e-12  # of poses; singularities do not make it larger
ANGLES = 1e-10  # of joint angles, where the singularities are farther away than 0.05 rad or m
ELBOW_STRAIGHT = -np.arctan2(0.1885 + 0.1625, 0.042)  # q3 with joints 2, 3 and the wrist in one line
HOME = np.array([0.3, 0.4, -0.5, 0.6, 0.7, 0.8])


def irb1200() -> RobotModel:
    return load_robot("irb1200")


def with_base_and_tool() -> RobotModel:
    robot = irb1200()
    robot.base = Placement(np.array([-0.265, 0.4, 0.498]), np.array([35.0, -20.0, 110.0]))
    robot.tool = Placement(np.array([0.03, -0.05, 0.21]), np.array([-75.0, 40.0, 12.0]))
    return robot


def with_offsets_and_backward_axes() -> RobotModel:
    """Also what the IRB 1200 lacks: offsets l_12x and l_23x, axes that turn the other way."""
    robot = with_base_and_tool()
    robot.joints[1].placement.translation = np.array([0.1, 0.0, 0.18])
    robot.joints[2].placement.translation = np.array([-0.03, 0.0, 0.35])
    for i in (1, 3, 5):
        robot.joints[i].axis = -robot.joints[i].axis
    return robot


ROBOTS = [irb1200, with_base_and_tool, with_offsets_and_backward_axes]


def regular(robot: RobotModel, n: int, seed: int) -> np.ndarray:
    """Random configurations within the limits, away from all singularities."""
    q = np.random.default_rng(seed).uniform(robot.lower, robot.upper, (4 * n, 6))
    s = np.linalg.svd(Kinematics(robot).jacobian(q))[1]
    return q[(s[:, -1] > 0.01) & (np.abs(np.sin(q[:, 4])) > 0.05)][:n]


@pytest.mark.parametrize("build", ROBOTS)
def test_every_branch_reproduces_the_pose(build: Callable[[], RobotModel]):
    robot = build()
    kinematics = Kinematics(robot)
    X_WE = kinematics.forward(np.random.default_rng(0).uniform(robot.lower, robot.upper, (1000, 6)))
    q = InverseKinematics(robot).all_branches(X_WE)
    reached = ~np.isnan(q[..., 0])
    assert q.shape == (1000, 8, 6)
    assert reached.sum(1).min() >= 4  # those of the shoulder that the pose was made with
    assert np.array_equal(np.isnan(q).any(-1), ~reached)
    assert np.all((q[reached] > -np.pi) & (q[reached] <= np.pi))
    poses = np.broadcast_to(X_WE[:, None], (1000, 8, 4, 4))
    assert kinematics.forward(q[reached]) == pytest.approx(poses[reached], abs=ROUNDING)


@pytest.mark.parametrize("build", ROBOTS)
def test_the_branches_differ_and_one_is_the_configuration_of_the_pose(build: Callable[[], RobotModel]):
    robot = build()
    q = regular(robot, 500, seed=1)
    branches = InverseKinematics(robot).all_branches(Kinematics(robot).forward(q))
    distance = np.abs(wrap_angle(branches - q[:, None])).max(-1)
    assert len(q) == 500
    assert np.nanmin(distance, 1).max() < ANGLES
    assert np.array_equal((distance < 1e-3).sum(1), np.ones(500))


@pytest.mark.parametrize("build", ROBOTS)
def test_nearest_returns_the_configuration_of_the_pose_also_beyond_half_a_turn(
    build: Callable[[], RobotModel],
):
    robot = build()
    q = regular(robot, 1000, seed=2)
    X_WE, inverse = Kinematics(robot).forward(q), InverseKinematics(robot)
    assert np.abs(q[:, 3]).max() > np.deg2rad(260.0)
    assert np.abs(q[:, 5]).max() > np.deg2rad(390.0)
    near = q + np.random.default_rng(3).uniform(-0.02, 0.02, q.shape)
    found = np.array([inverse.nearest(X, q_near) for X, q_near in zip(X_WE, near, strict=True)])
    assert found == pytest.approx(q, abs=ANGLES)


def test_nearest_is_the_nearest_of_all_branches_and_turns():
    robot = with_base_and_tool()
    inverse, rng = InverseKinematics(robot), np.random.default_rng(4)
    turns = 2.0 * np.pi * np.array(list(product([-1, 0, 1], repeat=6)))
    X_WE = Kinematics(robot).forward(regular(robot, 60, seed=5))
    for X, q_near in zip(X_WE, rng.uniform(robot.lower, robot.upper, (60, 6)), strict=True):
        every = (inverse.all_branches(X)[:, None] + turns).reshape(-1, 6)
        allowed = every[np.all((every >= robot.lower) & (every <= robot.upper), -1)]
        shortest = np.linalg.norm(allowed - q_near, axis=1).min()
        assert np.linalg.norm(inverse.nearest(X, q_near) - q_near) == pytest.approx(shortest, abs=1e-9)


@cache
def with_tool_solved() -> tuple[RobotModel, Kinematics, InverseKinematics]:
    robot = with_base_and_tool()
    return robot, Kinematics(robot), InverseKinematics(robot)


@given(st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6))
def test_nearest_reproduces_every_pose_within_the_limits_singular_or_not(shares: list[float]):
    robot, kinematics, inverse = with_tool_solved()
    q = robot.lower + np.array(shares) * (robot.upper - robot.lower)
    found = inverse.nearest(kinematics.forward(q), q)
    assert np.all((found >= robot.lower) & (found <= robot.upper))
    # An angle beyond its limit by less than 1e-9 rad is put on it.
    assert kinematics.forward(found) == pytest.approx(kinematics.forward(q), abs=3e-9)


@pytest.mark.parametrize("q5", [0.0, 1e-12])
def test_with_a_straight_wrist_axis_4_stays_where_it_is(q5: float):
    robot = irb1200()
    q = np.array([0.3, 0.4, -0.5, 4.0, q5, -5.0])
    assert InverseKinematics(robot).nearest(Kinematics(robot).forward(q), q) == pytest.approx(q, abs=1e-9)


def test_with_the_wrist_on_axis_1_that_axis_stays_where_it_is():
    robot = irb1200()
    # The forearm leans back by as much as the upper arm leans forward.
    q2 = 0.3
    forearm = -np.arcsin(0.35 * np.sin(q2) / np.hypot(0.351, 0.042))
    q = np.array([1.2, q2, forearm + ELBOW_STRAIGHT - q2, 0.4, 0.9, 0.1])
    assert InverseKinematics(robot).nearest(Kinematics(robot).forward(q), q) == pytest.approx(q, abs=ANGLES)


def test_rotation_and_position_can_be_given_apart():
    inverse, X = InverseKinematics(irb1200()), Kinematics(irb1200()).forward(HOME)
    assert np.array_equal(inverse.nearest(X[:3], HOME), inverse.nearest(X, HOME))


def test_a_path_through_many_turns_and_a_straight_wrist_is_continuous():
    robot = with_base_and_tool()
    ends = np.deg2rad([[-100.0, -20.0, -30.0, -260.0, 0.0, -390.0], [100.0, 30.0, 20.0, 260.0, 0.0, 390.0]])
    s = np.linspace(0.0, 1.0, 1001)
    path = ends[0] + s[:, None] * (ends[1] - ends[0])
    path[:, 4] = np.cos(np.pi * s)  # zero in the middle, where axis 4 is left open
    found = InverseKinematics(robot).along(Kinematics(robot).forward(path), path[0])
    # At the sample on the singularity axis 4 keeps the angle of the sample before, half a degree back.
    singular = np.abs(path[:, 4]) < 1e-9
    assert singular.sum() == 1
    assert found[~singular] == pytest.approx(path[~singular], abs=1e-9)
    assert np.abs(np.diff(found, axis=0)).max() < 0.03


def stretched() -> tuple[np.ndarray, np.ndarray]:
    """A stretched arm, and the direction from axis 2 to the wrist."""
    q = HOME.copy()
    q[2] = ELBOW_STRAIGHT
    return q, np.array([np.cos(q[0]) * np.sin(q[1]), np.sin(q[0]) * np.sin(q[1]), np.cos(q[1])])


def test_a_stretched_arm_is_reached():
    robot, (q, _) = irb1200(), stretched()
    # Rounding of 1e-16 m of the length changes the elbow by its root, 1e-8 rad.
    assert InverseKinematics(robot).nearest(Kinematics(robot).forward(q), q) == pytest.approx(q, abs=1e-7)


def test_out_of_reach_says_by_how_much():
    robot, (q, direction) = irb1200(), stretched()
    X, inverse = Kinematics(robot).forward(q), InverseKinematics(robot)
    X[:3, 3] += 0.0123 * direction
    with pytest.raises(
        UnreachableError, match=r"12\.300 mm too far from axis 2, allowed are 3\.5 to 703\.5 mm"
    ):
        inverse.nearest(X, q)
    assert np.isnan(inverse.all_branches(X)).all()
    X[:3, 3] -= (0.0123 + 0.7035) * direction
    with pytest.raises(UnreachableError, match=r"3\.500 mm too close to axis 2"):
        inverse.nearest(X, q)


def test_a_joint_beyond_its_limits_is_named_with_its_angle():
    robot = irb1200()
    robot.joints[0].limits.lower_deg, robot.joints[0].limits.upper_deg = -10.0, 10.0
    q = np.deg2rad([40.0, 20.0, 10.0, 30.0, 50.0, 60.0])
    message = r"^joint 1 would be at 40\.00 deg, allowed are -10 to 10 deg$"
    with pytest.raises(JointLimitError, match=message):
        InverseKinematics(robot).nearest(Kinematics(robot).forward(q), q)


def test_a_joint_at_its_limit_turns_back_rather_than_beyond():
    robot = irb1200()
    # Without these limits the flipped wrist or the other elbow would be nearer than a full turn.
    robot.joints[2].limits.lower_deg, robot.joints[4].limits.lower_deg = -60.0, 0.0
    q, target = HOME.copy(), HOME.copy()
    q[5], target[5] = robot.upper[5] - 0.01, robot.upper[5] + 0.01
    found = InverseKinematics(robot).nearest(Kinematics(robot).forward(target), q)
    target[5] -= 2.0 * np.pi
    assert found == pytest.approx(target, abs=ANGLES)


def test_a_path_names_the_sample_that_fails():
    robot, (q, direction) = irb1200(), stretched()
    X = np.tile(Kinematics(robot).forward(q), (5, 1, 1))
    X[:, :3, 3] += np.linspace(-0.003, 0.001, 5)[:, None] * direction  # sample 3 is right at the limit
    with pytest.raises(UnreachableError, match=r"^sample 4 of 5: out of reach: .* 1\.000 mm too far"):
        InverseKinematics(robot).along(X, q)


@pytest.mark.parametrize("entry", [np.nan, np.inf])
def test_refuses_what_is_not_finite(entry: float):
    inverse, X = InverseKinematics(irb1200()), Kinematics(irb1200()).forward(HOME)
    q = HOME.copy()
    q[2] = entry
    with pytest.raises(ValueError, match="not finite"):
        inverse.nearest(X, q)
    X[1, 2] = entry
    with pytest.raises(ValueError, match="not finite"):
        inverse.nearest(X, HOME)


@pytest.mark.parametrize(
    ("number", "attribute", "value", "message"),
    [
        (3, "axis", [1.0, 0.0, 0.0], r"axis of joint 3 must point along y .* got \[1\.0, 0\.0, 0\.0\]"),
        (6, "zyx_deg", [0.0, 80.0, 0.0], "axis of joint 6 must point along x"),
        (5, "translation", [0.1625, 0.0, 0.02], r"joint 5 must have no offset along z, got 20\.000 mm"),
        (6, "translation", [0.082, 0.005, 0.0], r"joint 6 must have no offset along y, got 5\.000 mm"),
        (3, "translation", [0.0, 0.0, 0.0], "upper arm or the forearm has no length"),
    ],
)
def test_says_what_does_not_fit_in_another_structure(number: int, attribute: str, value: list, message: str):
    robot = irb1200()
    joint = robot.joints[number - 1]
    setattr(joint if attribute == "axis" else joint.placement, attribute, np.array(value))
    with pytest.raises(ValueError, match=message):
        InverseKinematics(robot)
