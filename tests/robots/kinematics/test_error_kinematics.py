"""Error kinematics: the nominal robot at zero, its own derivative, and the plant that is really wrong."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.multibody.plant import MultibodyPlant

from robots.description.error_parameters import NUM_PARAMETERS, OFFSETS, error_parameters, parameter_names
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import Placement, RobotModel, load_robot
from robots.dynamics.plant import add_robot
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error, rotation_from_zyx

UNITS = np.where(
    [parameter.unit == "m" for parameter in error_parameters(load_robot("irb1200"))], 6e-3, np.deg2rad(0.9)
)


def with_tool() -> RobotModel:
    robot = load_robot("irb1200")
    robot.base = Placement(np.array([-0.265, 0.4, 0.498]), np.array([35.0, -20.0, 110.0]))
    robot.tool = Placement(np.array([0.03, -0.05, 0.21]), np.array([-75.0, 40.0, 12.0]))
    return robot


ROBOTS = {"plain": load_robot("irb1200"), "with base and tool": with_tool()}


def configurations(robot: RobotModel, count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(robot.lower, robot.upper, (count, 6))


def errors(seed: int, size: float = 1.0) -> np.ndarray:
    """All 48 parameters, normal with 6 mm and 0.9 degrees."""
    return size * UNITS * np.random.default_rng(seed).normal(size=NUM_PARAMETERS)


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_without_errors_it_is_the_nominal_kinematics(robot: RobotModel):
    q = configurations(robot, 100)
    model, zero = ErrorKinematics(robot), np.zeros(NUM_PARAMETERS)
    X_WE, J = Kinematics(robot).forward_and_jacobian(q)
    np.testing.assert_allclose(model.forward(q, zero), X_WE, atol=1e-14)
    np.testing.assert_allclose(model.jacobian(q, zero), J, atol=1e-14)


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
@pytest.mark.parametrize("size", [0.0, 1.0, 30.0])
def test_the_regressor_is_the_derivative_at_any_errors(robot: RobotModel, size: float):
    """Central differences with a step of 1e-5 are right to 1e-10 times the third derivative."""
    model, p, q = ErrorKinematics(robot), errors(1, size), configurations(robot, 20)
    Theta, h = model.regressor(q, p), 1e-5
    for k in range(NUM_PARAMETERS):
        step = h * np.eye(NUM_PARAMETERS)[k]
        difference = pose_error(model.forward(q, p + step), model.forward(q, p - step)) / (2.0 * h)
        np.testing.assert_allclose(Theta[..., k], difference, atol=2e-9, err_msg=model.parameters[k].name)


@pytest.mark.slow
@given(st.lists(st.floats(-3.0, 3.0), min_size=NUM_PARAMETERS, max_size=NUM_PARAMETERS))
@settings(max_examples=50, deadline=None)
def test_a_robot_file_can_hold_all_errors(scales: list[float]):
    p = UNITS * np.array(scales)
    for robot in ROBOTS.values():
        model, q = ErrorKinematics(robot), configurations(robot, 5)
        wrong = model.robot_with_errors(p)
        np.testing.assert_allclose(Kinematics(wrong).forward(q), model.forward(q, p), atol=1e-12)
        again = GeometricErrors.from_vector(robot, p).vector(robot)
        np.testing.assert_allclose(again, p, rtol=1e-15, atol=0.0)


@pytest.mark.parametrize("elasticity", ["rigid", "joints"])
def test_the_true_plant_is_wrong_in_all_48(elasticity: str):
    robot, p = with_tool(), errors(2)
    plant = MultibodyPlant(0.0)
    tool = add_robot(plant, robot, elasticity, errors=GeometricErrors.from_vector(robot, p)).tool
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for q in configurations(robot, 20):
        positions = np.zeros(plant.num_positions())
        positions[[plant.GetJointByName(f"motor_{i}").position_start() for i in range(1, 7)]] = q
        plant.SetPositions(context, positions)
        X_WE = tool.CalcPoseInWorld(context).GetAsMatrix4()
        np.testing.assert_allclose(ErrorKinematics(robot).forward(q, p), X_WE, atol=1e-12)


def test_the_errors_of_table_6_1_are_offsets_of_the_joints_and_of_the_tool():
    robot = ROBOTS["plain"]
    offsets = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5])
    table = GeometricErrors(offsets, np.array([10.0, 10.0, 10.0]), np.array([0.0, 0.0, 0.1]))
    p, q = table.vector(robot), configurations(robot, 10)
    X_WF = Kinematics(robot).forward(q + np.deg2rad(offsets))  # its tool sits in the flange
    X_FE = np.eye(4)
    X_FE[:3, :3], X_FE[:3, 3] = rotation_from_zyx(np.deg2rad([0.0, 0.0, 0.1])), 0.01
    np.testing.assert_allclose(ErrorKinematics(robot).forward(q, p), X_WF @ X_FE, atol=1e-14)


def test_names_follow_the_order_of_the_parameters():
    names = parameter_names(ROBOTS["plain"])
    assert len(set(names)) == NUM_PARAMETERS
    assert names[OFFSETS] == ("p_q1", "p_q2", "p_q3", "p_q4", "p_q5", "p_q6")
    rotations = (
        "alpha0 beta0 gamma0 alpha1 beta1 alpha2 gamma2 alpha3 gamma3 beta4 gamma4 alpha5 gamma5 alpha6 beta6"
    )
    assert names[30:] == (*(f"p_{name}" for name in rotations.split()), "p_alpha_E", "p_beta_E", "p_gamma_E")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            GeometricErrors(frame_translation_mm={"pl_99": np.zeros(3)}),
            "must be one of pl_I0, .* got 'pl_99'",
        ),
        (
            GeometricErrors(body_rotation_deg={"body_2": np.array([0.0, 0.3, 0.0])}),
            "axis of joint 2, must be 0",
        ),
        (GeometricErrors(joint_offset_deg=np.full(6, np.nan)), "must be finite"),
    ],
)
def test_errors_that_have_no_place_are_refused(wrong: GeometricErrors, message: str):
    with pytest.raises(ValueError, match=message):
        wrong.vector(ROBOTS["plain"])
