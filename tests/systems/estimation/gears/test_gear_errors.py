"""Shapes of gear errors: what they are, and an estimator that knows them against one that does not."""

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.drivetrain.dahl import DahlHysteresis
from robots.drivetrain.stiffness import CubicSpring
from robots.drivetrain.train import DriveTrains, JointTrain
from robots.pose import pose_error
from systems.estimation.gears.gear_errors import BEFORE, GearErrors
from systems.estimation.tip_estimator import TipEstimator
from systems.estimation.tip_estimator_config import TipEstimatorConfig
from tests.systems.estimation.arms import PERIOD, MovingArm, tip_model


@pytest.fixture(scope="module")
def robot():
    return load_robot("irb1200")


def hysteresis(gears: GearErrors, model: int = 0):
    """The memory of gears of which one model is right."""
    memory = gears.layout.view(np.zeros(gears.layout.size))
    memory.shares[model] = 1.0
    return memory


def springs(gears: GearErrors, half_gap: float = 5e-5):
    sizes = np.zeros((7, 6))
    sizes[5:] = 0.5 * half_gap
    return gears.springs(np.ones(6), sizes)


def test_waves_are_of_one_and_two_turns_of_the_motor(robot):
    gears, states = GearErrors(robot), np.zeros(18)
    one_turn = 2.0 * np.pi / robot.gear_ratio
    theta = np.full(6, 0.3)
    there = gears.shapes(theta, states)
    np.testing.assert_allclose(gears.shapes(theta + one_turn, states), there, atol=1e-9)
    np.testing.assert_allclose(gears.shapes(theta + one_turn / 2.0, states)[:2], -there[:2], atol=1e-9)
    np.testing.assert_allclose(gears.shapes(theta + one_turn / 2.0, states)[2:4], there[2:4], atol=1e-9)


def test_teeth_lie_where_the_spring_yields_to_and_stay_there_without_a_load(robot):
    gears, torque = GearErrors(robot), np.array([5.0, -5.0, 0.3, -0.3, 2.0, -2.0])
    memory = hysteresis(gears)
    teeth = [
        gears.shapes(np.zeros(6), gears.step(memory, springs(gears), each, 4e-3))[5]
        for each in (torque, 0.0 * torque)
    ]
    np.testing.assert_array_equal(teeth, [-np.sign(torque)] * 2)


def test_teeth_cross_their_gap_against_the_grease_which_takes_an_impulse(robot):
    gears, ramp = GearErrors(robot), 2.0  # N m/s
    ways = []
    for period in (4e-3, 1e-3):
        memory = hysteresis(gears)
        times = np.arange(-0.1, 0.1, period)
        states = [gears.step(memory, springs(gears), np.full(6, ramp * t), period) for t in times]
        way = np.array([gears.shapes(np.zeros(6), state)[5, 0] for state in states])
        assert (way[times < 0.0] == 1.0).all()
        ways.append(times[np.argmax(way < 0.0)])
        assert way[-1] == -1.0
    # The middle of the gap: the impulse is half the ramp times the square of the time since zero.
    assert 0.5 * ramp * ways[1] ** 2 == pytest.approx(2e-3, rel=0.1)
    assert ways[0] == pytest.approx(ways[1], abs=4e-3)


def test_how_far_a_gear_yields_decides_how_far_its_hysteresis_turns_over(robot):
    """Dahl's state after a turn by 2 c T across no gap, and by twice the half gap more with one."""
    gears, torque = GearErrors(robot), 2e-4 * robot.joint_stiffness
    for factor, half_gap in ((1.0, 2.5e-5), (1.5, 2.5e-5), (1.0, 1e-4)):
        known = gears.springs(np.full(6, factor), np.full((7, 6), 0.5 * half_gap))
        memory = hysteresis(gears)
        for share in (-1.0, *np.linspace(-1.0, 1.0, 4001)):
            state = gears.step(memory, known, share * torque, 1e-3)[:6]
        # It carries a tenth of what it turns over by, so much less is left to the spring.
        turn = 2.0 * (factor * 2e-4 + half_gap) - factor * 0.1 * 3.5e-4 * np.abs(state)
        np.testing.assert_allclose(state, -(1.0 - np.exp(-turn / 3.5e-4)), rtol=0.02)


def test_hysteresis_tells_from_which_side_a_load_was_reached(robot):
    gears = GearErrors(robot)
    large = 3e-3 * robot.joint_stiffness  # N m, six times the larger width

    def after(torques):
        memory = hysteresis(gears)
        return [gears.step(memory, springs(gears), torque, 4e-3)[:6] for torque in torques][-1]

    loaded = after([np.zeros(6), -large])
    np.testing.assert_allclose(loaded, 1.0, atol=3e-3)  # it follows the deflection
    np.testing.assert_allclose(after([np.zeros(6), -large, large]), -1.0, atol=3e-3)
    # At the same load it tells from which side that was reached.
    assert (after([0 * large, large, 0 * large]) > 0.9).all()
    assert (after([0 * large, -large, 0 * large]) < -0.9).all()


def test_what_is_expected_of_gears_is_the_mean_of_their_models(robot):
    gears, times = GearErrors(robot), np.arange(0.0, 1.0, 4e-3)
    torques = 3e-4 * robot.joint_stiffness * np.sin(7.0 * times)[:, None]
    mixed, alone = gears.layout.view(np.zeros(gears.layout.size)), [hysteresis(gears, k) for k in range(6)]
    for torque in torques:
        found, *each = [gears.step(memory, springs(gears), torque, 4e-3) for memory in (mixed, *alone)]
        np.testing.assert_allclose(found, BEFORE[:, 0] @ each, atol=1e-12)
    assert np.ptp(each, axis=0)[:6].min() > 0.01  # they differ


@pytest.mark.parametrize("right", [0, 1, 5])
def test_a_camera_shows_which_model_of_a_gear_is_right(robot, right):
    """From tips that one model moves, against the mean of all; joints that nothing moves say nothing."""
    gears, rng, J = GearErrors(robot), np.random.default_rng(right), np.zeros((6, 6))
    J[3:] = 0.5 * rng.uniform(-1.0, 1.0, (3, 6))  # m
    weights, against = np.repeat([1e-4, 5e-5], 3) ** -2.0, np.zeros((6, 6))
    np.testing.assert_allclose(gears.likely(against), BEFORE)
    for _ in range(2000):
        others = 8e-5 * rng.uniform(-1.0, 1.0, (6, 6))  # rad, which teeth are elsewhere by at times
        others -= (BEFORE * others).sum(0)
        others[:, 3:] = 0.0
        r = J @ others[right] + rng.normal(size=6) / np.sqrt(weights)
        gears.weigh(against, J, r, weights, others)
    likely = gears.likely(against)
    np.testing.assert_allclose(likely.sum(axis=0), 1.0)
    assert (likely[right, :3] > 0.9).all()
    np.testing.assert_allclose(likely[:, 3:], BEFORE[:, 3:])


@pytest.mark.parametrize("load", [-1.5, -0.2, 0.0, 0.4, 3.0])  # of what the hysteresis carries
@pytest.mark.parametrize("unknown", [0.0, 0.7])  # of the gap, and of what the hysteresis carries
def test_gears_may_be_off_by_the_side_of_teeth_that_nearly_nothing_pushes(robot, load, unknown):
    """Against teeth whose side is drawn, by a push that is known to no more than what hysteresis does."""
    gears, turned, spring = GearErrors(robot), 0.3, 0.1 * np.asarray(robot.joint_stiffness)
    carried = spring * 3.5e-4 * turned  # N m, before they cross
    sizes, states = np.zeros((2, 7, 6)), np.repeat([turned, 1.0, -0.4], 6)
    sizes[0, 5], sizes[0, 6], sizes[1, 6] = 20e-6, 50e-6, (50e-6 * unknown) ** 2
    crossing = spring * 2.0 * np.sqrt(70e-6**2 + sizes[1, 6])  # N m, while they do
    torque = load * carried, (unknown * carried) ** 2
    rng = np.random.default_rng(0)
    unsure = np.sqrt(carried**2 + crossing**2 + torque[1])
    push = torque[0] + 0.5 * carried + unsure * rng.normal(size=(20000, 1))
    held = 50e-6 * (1.0 + unknown * rng.normal(size=(20000, 1)))
    expected = np.mean((-np.sign(push) * (20e-6 + held) - (20e-6 - 0.4 * held)) ** 2, axis=0)
    found = gears.variances((sizes[0], sizes[1]), states, torque, 0.0)
    # A mean of 20000 draws, of squares that scatter by up to three times their mean
    np.testing.assert_allclose(found, expected, rtol=0.05, atol=(1e-6) ** 2)
    least = gears.variances((sizes[0] * 0.0, sizes[0] * 0.0), states, torque, 5e-5)
    np.testing.assert_allclose(least, (5e-6) ** 2)


@pytest.mark.slow
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


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_two_gaps_make_up_the_motion_of_a_gear_whose_hysteresis_carries_in_its_gap_or_does_not(robot, share):
    k, gap, period = robot.joint_stiffness[0], 1.4e-4, 1e-3
    held = DahlHysteresis((share * k,), (5e-4,))
    train = DriveTrains([JointTrain(CubicSpring(k, 0.0), 0.0, 1.0, gap=gap, lubricant=20.0, hysteresis=held)])
    gears, times = GearErrors(robot), np.arange(0.0, 8.0, period)
    # It turns over slowly, and more widely each time.
    x = 1e-4 * (1.0 + 0.1 * times) * np.cos(2.0 * np.pi * times / 2.0)
    rate, memory, z = np.gradient(x, period), hysteresis(gears), np.zeros(1)
    columns, still = [], (np.zeros(1), np.zeros(1))
    for each, speed in zip(x, rate, strict=True):
        found = train.torques(z, still, (np.array([each]), np.array([speed])), np.zeros(1))
        z = z + period * found.state_rate
        torque = np.full(6, found.link[0])
        states = gears.step(memory, springs(gears, 0.5 * gap), torque, period)
        columns.append([torque[0] / k, *gears.shapes(np.zeros(6), states)[4:, 0]])

    def left(chosen):
        A = np.array(columns)[:, chosen]
        return np.abs(x - A @ np.linalg.lstsq(A, x, rcond=None)[0]).max()

    assert left([0, 1, 2, 3]) < 0.6 * gap  # the grease is half as thick as is believed: it is crossed earlier
    if share:
        assert left([0, 1, 2]) > 0.7 * gap  # open, it is crossed at another time
