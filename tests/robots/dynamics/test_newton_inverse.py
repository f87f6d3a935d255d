"""Inverse kinematics of a robot with all geometric errors: exact, on its branch, clear where it ends."""

from dataclasses import replace

import numpy as np
import pytest

from robots.description.error_parameters import NUM_PARAMETERS, OFFSETS
from robots.description.model import Placement, RobotModel, load_robot
from robots.dynamics.newton_inverse import NewtonInverse, ideal_robot, inverse_kinematics
from robots.kinematics.analytic_inverse import InverseKinematics, JointLimitError, UnreachableError
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics
from systems.reference.paths import ReferenceConfig, make_path

NOMINAL = load_robot("irb1200")


def wrong(seed: int, millimetres: float = 6.0, degrees: float = 0.9) -> RobotModel:
    """A robot with all 48 errors, uniform within the given bounds."""
    bounds = np.full(NUM_PARAMETERS, np.deg2rad(degrees))
    bounds[OFFSETS.stop : OFFSETS.stop + 24] = 1e-3 * millimetres
    p = np.random.default_rng(seed).uniform(-bounds, bounds)
    return ErrorKinematics(NOMINAL).robot_with_errors(p)


def test_an_exact_robot_keeps_the_analytic_solution_and_is_its_own_ideal():
    assert isinstance(inverse_kinematics(NOMINAL), InverseKinematics)
    q = np.random.default_rng(0).uniform(NOMINAL.lower, NOMINAL.upper, (50, 6))
    np.testing.assert_allclose(
        Kinematics(ideal_robot(NOMINAL)).forward(q), Kinematics(NOMINAL).forward(q), atol=1e-14
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_path_of_the_tool_is_met_to_rounding(seed: int):
    robot = wrong(seed)
    inverse = inverse_kinematics(robot)
    assert isinstance(inverse, NewtonInverse)
    path = make_path(ReferenceConfig())
    X_WE = path.sample(np.arange(0.0, path.duration, 0.02))[0]
    home = InverseKinematics(NOMINAL).nearest(X_WE[0], np.deg2rad([0.0, 30.0, 20.0, 0.0, 40.0, 0.0]))
    q = inverse.along(X_WE, home)
    np.testing.assert_allclose(Kinematics(robot).forward(q), X_WE, atol=1e-13)
    assert np.abs(np.diff(q, axis=0)).max() < 0.1  # no jump to another branch


def test_random_poses_are_met_whatever_the_start():
    """Away from singularities, where a robot with errors need not have the ideal one's branches."""
    robot, rng = wrong(7), np.random.default_rng(1)
    kinematics, inverse = Kinematics(robot), NewtonInverse(robot)
    inner = 0.8 * np.stack([robot.lower, robot.upper])
    found = 0
    while found < 200:
        q, start = rng.uniform(*inner), rng.uniform(*inner)
        X_WE, J = kinematics.forward_and_jacobian(q)
        if abs(np.linalg.det(J)) < 0.01:
            continue
        found += 1
        np.testing.assert_allclose(kinematics.forward(inverse.nearest(X_WE, start)), X_WE, atol=1e-12)
        np.testing.assert_allclose(inverse.nearest(X_WE, q + 0.01), q, atol=1e-9)


@pytest.mark.parametrize("away", [0.002, 0.005, 0.02])
@pytest.mark.parametrize("share", [0.1, 1.0])
def test_every_pose_near_a_singularity_of_the_wrist_is_met(away: float, share: float):
    """Within these angles of joint 5 the ideal wrist stands up to a quarter turn from the true one."""
    robot, rng = wrong(2, 6.0 * share, 0.9 * share), np.random.default_rng(1)
    kinematics, inverse = Kinematics(robot), NewtonInverse(robot)
    for _ in range(60):
        q, start = rng.uniform(0.95 * robot.lower, 0.95 * robot.upper, (2, 6))
        q[4] = rng.uniform(-away, away)
        X_WE = kinematics.forward(q)
        np.testing.assert_allclose(kinematics.forward(inverse.nearest(X_WE, start)), X_WE, atol=1e-9)


def test_a_straight_path_through_the_singularity_of_the_wrist_stays_on_its_branch():
    robot = wrong(5, 0.6, 0.09)
    q5 = np.linspace(0.3, -0.3, 401)
    q = np.deg2rad([10.0, 30.0, 20.0, 5.0, 0.0, 10.0]) + q5[:, None] * np.eye(6)[4]
    np.testing.assert_allclose(NewtonInverse(robot).along(Kinematics(robot).forward(q), q[0]), q, atol=1e-6)


def test_what_cannot_be_reached_is_refused_with_the_reason():
    robot = wrong(3)
    inverse, far = NewtonInverse(robot), np.eye(4)
    far[0, 3] = 3.0
    with pytest.raises(UnreachableError, match="out of reach"):
        inverse.nearest(far, np.zeros(6))
    q = 0.5 * (robot.lower + robot.upper)
    q[4] = 0.7
    X_WE = Kinematics(robot).forward(q)
    joints = list(robot.joints)
    limits = replace(joints[1].limits, upper_deg=float(np.rad2deg(q[1]) - 1.0))
    joints[1] = replace(joints[1], limits=limits)
    with pytest.raises(JointLimitError, match="joint 2 would be at"):
        NewtonInverse(replace(robot, joints=joints)).nearest(X_WE, q)
    with pytest.raises(ValueError, match="not finite"):
        inverse.nearest(np.full((4, 4), np.nan), np.zeros(6))


def test_a_robot_of_another_kind_has_no_ideal_and_is_solved_numerically():
    joints = list(NOMINAL.joints)
    joints[4] = replace(joints[4], placement=Placement(np.array([0.45, 0.1, 0.0])))
    robot = replace(NOMINAL, joints=joints)
    with pytest.raises(ValueError, match=r"joint 5 must have nearly no offset along y, got 100\.0 mm"):
        ideal_robot(robot)
    q = np.deg2rad([10.0, 20.0, 10.0, 15.0, 40.0, -30.0])
    X_WE = Kinematics(robot).forward(q)
    np.testing.assert_allclose(inverse_kinematics(robot).nearest(X_WE, q + 0.02), q, atol=1e-9)
