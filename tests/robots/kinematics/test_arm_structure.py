"""The analytic inverse in other frames: offset shoulder, base anywhere, other zeros, directions, origins."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from robots.description.model import Joint, JointLimits, Placement, RobotModel, load_robot
from robots.kinematics.analytic_inverse import InverseKinematics, UnreachableError
from robots.kinematics.arm_structure import aligned, has_spherical_wrist
from robots.kinematics.forward import Kinematics
from robots.pose import wrap_angle


def described_otherwise(robot: RobotModel, seed: int) -> RobotModel:
    """The same machine: base anywhere, random zeros, directions and frames of the links, tool included."""
    rng, joints, undo = np.random.default_rng(seed), [], RigidTransform()
    for joint, axis in zip(robot.joints, robot.axes, strict=True):
        frame = Placement(np.zeros(3), rng.uniform(-180.0, 180.0, 3))
        slide = RigidTransform(rng.uniform(-0.2, 0.2) * axis)
        turn = Placement(np.zeros(3), rng.uniform(-40.0, 40.0) * axis[::-1]).pose()  # axes are x, y or z
        X = undo @ joint.placement.pose() @ slide @ turn @ frame.pose()
        direction = frame.pose().rotation().inverse() @ axis * rng.choice([-1.0, 1.0])
        limits = JointLimits(-170.0, 170.0, 100.0)
        joints.append(Joint(direction, Placement(X.translation(), angles(X)), limits))
        undo = (slide @ frame.pose()).inverse()
    X = undo @ robot.tool.pose()
    base = Placement(rng.uniform(-1.0, 1.0, 3), rng.uniform(-180.0, 180.0, 3))
    return replace(robot, base=base, joints=joints, tool=Placement(X.translation(), angles(X)))


def angles(X: RigidTransform) -> np.ndarray:
    return np.rad2deg(X.rotation().ToRollPitchYaw().vector()[::-1])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", ["irb1200", "kr16", "puma560"])
def test_every_branch_is_found_however_the_robot_is_described(name: str, seed: int):
    robot = described_otherwise(load_robot(name), seed)
    kinematics, inverse = Kinematics(robot), InverseKinematics(robot)
    q = np.random.default_rng(seed).uniform(0.9 * robot.lower, 0.9 * robot.upper, (100, 6))
    q = q[np.linalg.svd(kinematics.jacobian(q))[1][:, -1] > 0.02]
    X = kinematics.forward(q)
    branches = inverse.all_branches(X)
    assert np.nanmin(np.abs(wrap_angle(branches - q[:, None])).max(-1), axis=1).max() < 1e-9
    there = ~np.isnan(branches[..., 0])
    np.testing.assert_allclose(
        kinematics.forward(branches[there]), np.broadcast_to(X[:, None], (len(X), 8, 4, 4))[there], atol=1e-12
    )
    for pose, one in zip(X, q, strict=True):
        np.testing.assert_allclose(inverse.nearest(pose, one + 0.01), one, atol=1e-9)


@pytest.mark.parametrize("name", ["irb1200", "puma560"])
def test_the_aligned_robot_is_the_same_machine(name: str):
    robot = described_otherwise(load_robot(name), 9)
    found = aligned(robot)
    assert found is not None
    other, zeros = found
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (50, 6))
    np.testing.assert_allclose(Kinematics(other).forward(q), Kinematics(robot).forward(q + zeros), atol=1e-12)


def test_a_wrist_that_does_not_meet_or_parallel_axes_have_no_such_solution():
    assert not has_spherical_wrist(load_robot("ur10"))
    robot = load_robot("puma560")
    robot.joints[5].placement.translation = np.array([0.01, 0.0, 0.0])
    assert not has_spherical_wrist(robot)


def test_too_close_to_the_axis_beside_which_the_arm_moves_is_out_of_reach():
    """The arm of a Puma moves in a plane 150 mm beside axis 1; no branch reaches the axis."""
    robot = load_robot("puma560")
    X = np.eye(4)
    X[:3, 3] = [0.0, 0.0, 1.2]
    inverse = InverseKinematics(robot)
    assert np.isnan(inverse.all_branches(X)).all()
    with pytest.raises(
        UnreachableError, match=r"0\.0 mm from axis 1, and the arm moves 150\.\d mm beside it"
    ):
        inverse.nearest(X, np.zeros(6))
