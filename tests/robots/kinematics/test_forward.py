"""Forward kinematics and Jacobian against Drake's MultibodyPlant; the robust inverse by its definition."""

from collections.abc import Callable
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable, RevoluteJoint, SpatialInertia
from scipy.spatial.transform import Rotation

from robots.description.model import Placement, RobotModel, load_robot
from robots.kinematics.forward import (
    DAMPING,
    MANIPULABILITY_THRESHOLD,
    Kinematics,
    manipulability,
    robust_inverse,
    robust_solve,
    rotation_about,
)

ROUNDING = 1e-12  # the products of seven transforms, with lengths below 2 m, differ by far less


def plain() -> RobotModel:
    return load_robot("irb1200")


def with_base_and_tool() -> RobotModel:
    robot = plain()
    robot.base = Placement(np.array([-0.265, 0.4, 0.498]), np.array([35.0, -20.0, 110.0]))
    robot.tool = Placement(np.array([0.03, -0.05, 0.21]), np.array([-75.0, 40.0, 12.0]))
    return robot


def askew() -> RobotModel:
    """No axis along a coordinate axis, no frame parallel to another, one axis backward."""
    robot = with_base_and_tool()
    rng = np.random.default_rng(0)
    for joint in robot.joints:
        joint.axis = rng.normal(size=3)
        joint.placement = Placement(rng.normal(size=3) / 3.0, rng.uniform(-180.0, 180.0, 3))
    robot.joints[3].axis = np.array([0.0, -2.0, 0.0])
    return robot


def drake(robot: RobotModel) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Pose and Jacobian of the tool from a MultibodyPlant of the same robot."""
    plant = MultibodyPlant(0.0)
    unit = SpatialInertia.SolidSphereWithMass(1.0, 0.1)
    parent = plant.AddRigidBody("base", unit)
    plant.WeldFrames(plant.world_frame(), parent.body_frame(), robot.base.pose())
    for number, joint in enumerate(robot.joints, 1):
        link = plant.AddRigidBody(f"link_{number}", unit)
        socket = plant.AddFrame(FixedOffsetFrame(f"socket_{number}", parent, joint.placement.pose()))
        plant.AddJoint(RevoluteJoint(f"joint_{number}", socket, link.body_frame(), joint.axis))
        parent = link
    tool = plant.AddFrame(FixedOffsetFrame("tool", parent, robot.tool.pose()))
    plant.Finalize()
    context = plant.CreateDefaultContext()

    def evaluate(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        plant.SetPositions(context, q)
        world, origin = plant.world_frame(), np.zeros(3)
        J = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, tool, origin, world, world)
        X: RigidTransform = tool.CalcPoseInWorld(context)
        return X.GetAsMatrix4(), J

    return evaluate


def test_solving_is_multiplying_with_the_robust_inverse_also_at_a_singularity():
    kinematics = Kinematics(load_robot("irb1200"))
    for q5 in (0.8, 1e-5, 0.0):  # regular, damped, singular
        J = kinematics.jacobian(np.array([0.3, 0.2, 0.4, 0.1, q5, -0.5]))
        V = np.random.default_rng(5).normal(size=(6, 2))
        # The damped inverse is as large as 1 / (2 alpha) = 5e3.
        assert robust_solve(J, V) == pytest.approx(robust_inverse(J) @ V, abs=1e-8)
        assert robust_solve(J, V[:, 0]) == pytest.approx(robust_solve(J, V)[:, 0], abs=1e-8)


@pytest.mark.parametrize("build", [plain, with_base_and_tool, askew])
def test_pose_and_jacobian_are_those_of_drake(build: Callable[[], RobotModel]):
    robot = build()
    kinematics, reference = Kinematics(robot), drake(robot)
    q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (300, 6))
    X, J = kinematics.forward_and_jacobian(q)
    for k in range(len(q)):
        X_drake, J_drake = reference(q[k])
        assert X[k] == pytest.approx(X_drake, abs=ROUNDING)
        assert J[k] == pytest.approx(J_drake, abs=ROUNDING)


@pytest.mark.parametrize("build", [plain, with_base_and_tool, askew])
def test_one_configuration_gives_what_a_batch_gives(build: Callable[[], RobotModel]):
    robot = build()
    kinematics = Kinematics(robot)
    q = np.random.default_rng(2).uniform(robot.lower, robot.upper, (30, 6))
    X, J = kinematics.forward_and_jacobian(q)
    assert np.array([kinematics.forward(one) for one in q]) == pytest.approx(X, abs=1e-14)
    assert np.array([kinematics.jacobian(one) for one in q]) == pytest.approx(J, abs=1e-14)


def test_any_leading_shape_and_any_length_of_a_batch():
    kinematics = Kinematics(plain())
    q = np.random.default_rng(3).uniform(-3.0, 3.0, (2, 2500, 6))  # longer than a block of the computation
    X, J = kinematics.forward_and_jacobian(q)
    assert X.shape == (2, 2500, 4, 4)
    assert J.shape == (2, 2500, 6, 6)
    for index in [(0, 0), (0, 2499), (1, 0), (1, 2499)]:
        assert X[index] == pytest.approx(kinematics.forward(q[index]), abs=1e-14)
        assert J[index] == pytest.approx(kinematics.jacobian(q[index]), abs=1e-14)
    assert kinematics.forward(np.empty((0, 6))).shape == (0, 4, 4)


def test_at_zero_the_arm_points_forward():
    """The sums of the lengths in Probst (2024), table 2.1; the flange looks along x."""
    X = Kinematics(plain()).forward(np.zeros(6))
    assert X[:3, 3] == pytest.approx(
        [0.1885 + 0.1625 + 0.082, 0.0, 0.219 + 0.1801 + 0.350 + 0.042], abs=1e-15
    )
    assert X[:3, 2] == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)


@pytest.mark.parametrize("shape", [(5,), (7,), (6, 5), ()])
def test_refuses_other_than_six_joint_positions(shape: tuple[int, ...]):
    with pytest.raises(ValueError, match=r"must have the shape \(\.\.\., 6\), got"):
        Kinematics(plain()).forward(np.zeros(shape))


def test_a_robot_is_read_once_and_not_changed():
    robot = askew()
    before = deepcopy(robot)
    Kinematics(robot).forward_and_jacobian(np.ones((2, 6)))
    assert robot.joints[3].axis == pytest.approx(before.joints[3].axis)
    assert robot.base.pose().IsExactlyEqualTo(before.base.pose())


def jacobian(q5: float) -> np.ndarray:
    return Kinematics(plain()).jacobian(np.array([0.3, 0.4, -0.5, 0.6, q5, 0.7]))


def test_manipulability_is_the_product_of_the_singular_values():
    J = Kinematics(plain()).jacobian(np.random.default_rng(4).uniform(-2.0, 2.0, (50, 6)))
    assert manipulability(J) == pytest.approx(np.linalg.svd(J)[1].prod(-1), rel=1e-10, abs=1e-16)


def test_away_from_singularities_the_robust_inverse_is_the_inverse():
    J = np.array([jacobian(0.5), jacobian(-1.0)])
    assert manipulability(J).min() > MANIPULABILITY_THRESHOLD
    identity = np.tile(np.eye(6), (2, 1, 1))
    assert robust_inverse(J) @ J == pytest.approx(identity, abs=1e-12)
    assert robust_inverse(J[0]) == pytest.approx(robust_inverse(J)[0], abs=1e-12)


@pytest.mark.parametrize("q5", [0.0, 1e-6, 1e-3])
def test_near_singularities_the_robust_inverse_is_damped_as_defined(q5: float):
    J = jacobian(q5)
    w = manipulability(J)
    assert w < MANIPULABILITY_THRESHOLD
    alpha = DAMPING * (1.0 - w / MANIPULABILITY_THRESHOLD) ** 2
    # Multiplied out, because inverting J^T J would lose all digits; the inverse is of the order 1e4.
    assert (J.T @ J + alpha**2 * np.eye(6)) @ robust_inverse(J) == pytest.approx(J.T, abs=1e-10)
    # s / (s^2 + alpha^2) is at most 1 / (2 alpha), so joint velocities stay finite.
    assert np.linalg.norm(robust_inverse(J), 2) <= 0.5 / alpha * (1.0 + 1e-9)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.1),
    st.floats(-10.0, 10.0),
)
def test_rotation_about_an_axis_is_the_exponential(direction: list[float], angle: float):
    axis = np.array(direction) / np.linalg.norm(direction)
    expected = Rotation.from_rotvec(angle * axis).as_matrix()
    assert rotation_about(axis, angle) == pytest.approx(expected, abs=1e-14)
