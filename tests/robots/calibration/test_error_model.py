"""The complete error model against products of matrices, its derivative against finite differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.calibration.error_model import NUM_PLACED, ZEROS, ErrorModel
from robots.calibration.prior import parameter_sizes
from robots.description.joint_errors import KINDS
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error
from tests.robots.calibration.matrix_robot import MatrixRobot, homogeneous


def errors(model: ErrorModel, seed: int) -> np.ndarray:
    return parameter_sizes(model.names) * np.random.default_rng(seed).normal(size=len(model))


@pytest.mark.parametrize("name", ["irb1200", "irb140", "kr16", "kr210", "puma560", "ur10"])
def test_the_pose_is_the_product_of_placements_displacements_and_turns(name: str):
    model, robot = ErrorModel(load_robot(name), ["scale"]), MatrixRobot(name)
    x = errors(model, 0)
    moves = x[:NUM_PLACED].reshape(8, 6)
    turned = Rotation.from_rotvec(moves[:, 3:]), np.zeros((8, 3))
    robot.placements = (
        robot.placements @ homogeneous(Rotation.identity(8), moves[:, :3]) @ homogeneous(*turned)
    )
    zeros = homogeneous(Rotation.from_rotvec(x[ZEROS][:, None] * robot.axes), np.zeros((6, 3)))
    robot.placements[1:7] = robot.placements[1:7] @ zeros
    robot.scales = 1.0 + x[-6:]
    q = robot.configurations(50, np.random.default_rng(1))
    np.testing.assert_allclose(model.forward(q, x), robot.forward(q), atol=1e-13)


def test_the_regressor_is_the_derivative_of_the_pose():
    """Central differences of 1e-5 leave 1e-10 of curvature and 1e-11 of rounding."""
    model = ErrorModel(load_robot("irb1200"), tuple(KINDS))
    x, h = errors(model, 2), 1e-5
    q = np.random.default_rng(3).uniform(-2.0, 2.0, (10, 6))
    Theta = model.forward_and_regressor(q, x)[1]
    for column, step in enumerate(h * np.eye(len(model))):
        difference = pose_error(model.forward(q, x + step), model.forward(q, x - step)) / (2.0 * h)
        np.testing.assert_allclose(Theta[:, :, column], difference, atol=2e-9)


def test_a_robot_with_errors_is_a_robot_file_with_other_placements():
    robot = load_robot("kr16")
    model = ErrorModel(robot)
    x = errors(model, 4)
    q = np.random.default_rng(5).uniform(robot.lower, robot.upper, (50, 6))
    np.testing.assert_allclose(
        Kinematics(model.robot_with_errors(x)).forward(q), model.forward(q, x), atol=1e-13
    )


def test_wrong_shapes_are_refused():
    model = ErrorModel(load_robot("irb1200"))
    with pytest.raises(ValueError, match=r"must have the shape \(54,\), got \(60,\)"):
        model.forward(np.zeros((1, 6)), np.zeros(60))
    with pytest.raises(ValueError, match=r"must have the shape \(n, 6\), got \(6,\)"):
        model.forward(np.zeros(6), np.zeros(54))
