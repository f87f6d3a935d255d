"""The model of the tip: its derivatives by finite differences, and what a displaced tool is in it."""

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.pose import pose_error
from systems.controller_model import ControllerModel
from systems.estimation.tip_model import Spread, TipModel, moved
from tests.systems.estimation.arms import MovingArm, tip_model, true_unknowns


def test_columns_are_the_derivatives_of_the_tip():
    model = tip_model(gear_error=5e-5)
    x = true_unknowns(model, 1)
    pair = MovingArm(model, x).pair(0.7, noise=0.0)
    shapes = np.random.default_rng(0).uniform(-1.0, 1.0, (1, 7, 6))

    def tip(unknowns):
        rows = pair.theta[None], pair.loads[None], pair.twist[None], shapes
        return model.predict(model.constants(unknowns), unknowns, *rows)

    H, step = tip(x).H[0], 1e-4
    for k in range(model.size):
        change = np.zeros(model.size)
        change[k] = step * model.sigma[k]
        difference = pose_error(tip(x + change).X_WE, tip(x - change).X_WE)[0] / (2.0 * step)
        # What bearings and gears turn is small, and so is what the columns leave out: products of two.
        np.testing.assert_allclose(H[:, k], difference, atol=2e-3 * model.sigma[k] + 2e-7, rtol=2e-3)


def test_poses_near_the_constants_are_those_at_them():
    model = tip_model()
    x = true_unknowns(model, 2)
    near = x.copy()
    near[model.G] += 1e-4 * np.random.default_rng(0).uniform(-1.0, 1.0, near[model.G].shape)
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (5, 6))
    linear = model.forward(model.constants(x), near, q)[0]
    exact = model.forward(model.constants(near), near, q)[0]
    assert np.abs(pose_error(exact, linear)).max() < 1e-7


def test_the_directions_of_the_tool_displace_it():
    model = tip_model()
    pair = MovingArm(model, model.mean).pair(0.3, noise=0.0)
    rows = pair.theta[None], pair.loads[None], pair.twist[None]
    found = model.predict(model.constants(model.mean), model.mean, *rows)
    by_tool = found.H[0] @ model.tool_directions()
    # Its first three columns are 2 mm along the axes of the last link: a rigid displacement of any pose.
    np.testing.assert_allclose(by_tool[:3, :3], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(by_tool[3:, :3], axis=0), 2e-3, rtol=1e-9)
    assert np.linalg.matrix_rank(by_tool[:3, 3:], tol=1e-4) == 3


@pytest.mark.parametrize("angle", [1e-6, 1e-2])
def test_moved_turns_by_the_angle(angle):
    X = np.eye(4)[None]
    step = np.array([[0.6 * angle, -0.8 * angle, 0.0, 1e-3, 2e-3, 3e-3]])
    np.testing.assert_allclose(pose_error(moved(X, step), X), step, rtol=angle**2, atol=1e-15)


def test_of_a_calibrated_robot_more_is_known_and_the_same_can_be_seen():
    drawn = tip_model()
    robot = load_robot("irb1200")
    errors = np.random.default_rng(3).uniform(-1.0, 1.0, 48) * 5e-3
    calibrated = ErrorKinematics(robot).robot_with_errors(errors)
    calibrated.calibration.of, calibrated.calibration.source = "irb1200", "measured"
    belief = ControllerModel(calibrated, 7.0, elasticity="structure")
    model = TipModel(belief, Spread())
    assert np.array_equal(model.chosen, drawn.chosen)
    assert (model.sigma[model.G] < 0.1 * drawn.sigma[drawn.G]).all()
    q = np.random.default_rng(4).uniform(-1.0, 1.0, (3, 6))
    found = model.forward(model.constants(model.mean), model.mean, q)[0]
    np.testing.assert_allclose(found, ErrorKinematics(robot).forward(q, errors), atol=1e-12)


def test_a_load_may_be_off_by_more_the_more_a_robot_carries():
    """Five per cent of 210 kg are ten, which no robot of seven kilograms would believe."""
    sigmas = {}
    for name in ("puma560", "irb1200", "kr210"):
        model = TipModel(ControllerModel(load_robot(name), 2.0), Spread())
        sigmas[name] = model.sigma[model.M][0]
    assert sigmas["puma560"] == sigmas["irb1200"] == Spread().payload
    assert sigmas["kr210"] == pytest.approx(210.0 / 7.0 * Spread().payload)


def test_an_estimate_that_is_no_robot_is_kept_within_what_robots_are():
    model = TipModel(ControllerModel(load_robot("irb1200"), payload=7.0), Spread(gear_error=5e-5))
    x = model.mean + 6.0 * model.sigma  # of no load that the file knows, and of springs four times too soft
    np.testing.assert_array_equal(model.plausible(x), x)
    x[model.M], x[model.K] = -2000.0, 100.0
    bounded = model.plausible(x)
    assert bounded[model.M][0] >= -21.0
    assert bounded[model.K].max() <= 8.0
    np.testing.assert_array_equal(bounded[model.G], x[model.G])
