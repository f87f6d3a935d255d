"""Shapes of gear errors: what they are, and an estimator that knows them against one that does not."""

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.pose import pose_error
from systems.estimation.gear_errors import GearErrors
from systems.estimation.tip_estimator import TipEstimator, TipEstimatorConfig
from tests.systems.estimation.arms import PERIOD, MovingArm, tip_model


@pytest.fixture(scope="module")
def robot():
    return load_robot("irb1200")


def hysteresis(gears: GearErrors):
    return gears.layout.view(np.zeros(gears.layout.size))


def test_waves_are_of_one_and_two_turns_of_the_motor(robot):
    gears, torque, states = GearErrors(robot), np.zeros(6), np.zeros(12)
    one_turn = 2.0 * np.pi / robot.gear_ratio
    theta = np.full(6, 0.3)
    there = gears.shapes(theta, torque, states)
    np.testing.assert_allclose(gears.shapes(theta + one_turn, torque, states), there, atol=1e-9)
    np.testing.assert_allclose(
        gears.shapes(theta + one_turn / 2.0, torque, states)[:2], -there[:2], atol=1e-9
    )
    np.testing.assert_allclose(
        gears.shapes(theta + one_turn / 2.0, torque, states)[2:4], there[2:4], atol=1e-9
    )


def test_the_gap_is_where_the_spring_yields_to(robot):
    shapes = GearErrors(robot).shapes(np.zeros(6), np.array([5.0, -5.0, 0.0, 5.0, 5.0, 5.0]), np.zeros(12))
    np.testing.assert_allclose(shapes[4], [-1.0, 1.0, 0.0, -1.0, -1.0, -1.0], atol=1e-6)


def test_hysteresis_tells_from_which_side_a_load_was_reached(robot):
    gears = GearErrors(robot)
    large = 3e-3 * robot.joint_stiffness  # N m, six times the larger width

    def after(torques):
        memory = hysteresis(gears)
        return [gears.step(memory, torque) for torque in torques][-1]

    loaded = after([np.zeros(6), -large])
    np.testing.assert_allclose(loaded, 1.0, atol=3e-3)  # it follows the deflection
    np.testing.assert_allclose(after([np.zeros(6), -large, large]), -1.0, atol=3e-3)
    # At the same load it tells from which side that was reached.
    assert (after([0 * large, large, 0 * large]) > 0.9).all()
    assert (after([0 * large, -large, 0 * large]) < -0.9).all()


def test_columns_for_gear_errors_find_what_waves_and_gap_do_to_the_tip():
    true = tip_model(gear_error=5e-5)
    x = true.mean.copy()
    rng = np.random.default_rng(0)
    x[true.E] = 4e-5 * rng.choice([-1.0, 1.0], 42)
    arm = MovingArm(true, x)
    errors = []
    for spread in (5e-5, 0.0):
        model = tip_model(gear_error=spread)
        estimator = TipEstimator(model, TipEstimatorConfig())
        memory = estimator.layout.view(np.zeros(estimator.layout.size))
        estimator.start(memory)
        for k in range(400):
            estimator.add(memory, arm.pair(PERIOD * k))
            estimator.work(memory)
        worst = 0.0
        for k in range(350, 400, 7):
            pair = arm.pair(PERIOD * k, noise=0.0)
            left = pose_error(pair.X_WE, estimator.predict(memory, pair).X_WE[0])[3:]
            worst = max(worst, float(np.linalg.norm(left)))
        errors.append(worst)
    known, unknown = errors
    assert unknown > 60e-6  # m, six gears of 40 urad each over an arm of 0.7 m
    assert known < 0.4 * unknown
