"""The planner: motors that put the known robot's tip on the path, rates that fit, loads left alone."""

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.pose import pose_error
from systems.estimation.preview_planner import PreviewPlanner, Wanted
from systems.reference.cartesian_path import OutOfReachError
from systems.reference.paths import ReferenceConfig, make_path
from tests.systems.estimation.arms import tip_model, true_unknowns

PERIOD = 4e-3
NO_MOTION = np.zeros((3, 6))
START = np.array([0.91, 0.35, 0.12, 0.0, 1.1, 0.9])


class Session:
    """A planner on the rectangle, with parameters that may move."""

    def __init__(self, x: np.ndarray, model) -> None:
        self.path = make_path(ReferenceConfig(settle=1.6))
        self.model, self.x, self.rate = model, x, np.zeros(model.size)
        self.planner = PreviewPlanner(model, PERIOD)
        self.memory = self.planner.layout.view(np.zeros(self.planner.layout.size))
        X_WE = self.path.sample(0.0)[0]
        theta = inverse_kinematics(load_robot("irb1200")).nearest(X_WE, START)
        self.planner.start(self.memory, x, theta, X_WE)
        self.start, self.time = theta, 0.0

    def step(self):
        X_WE, V_WE, _ = self.path.sample(self.time)
        wanted = Wanted(X_WE, V_WE, NO_MOTION)
        plan = self.planner.step(self.memory, (self.x, self.rate), wanted, self.time, PERIOD)
        self.time += PERIOD
        return plan, X_WE


@pytest.fixture(scope="module")
def model():
    return tip_model(gear_error=5e-5)


def test_the_tip_of_the_known_robot_is_on_the_path(model):
    x = true_unknowns(model, 3)
    session = Session(x, model)
    while session.time < 3.5:
        plan, X_WE = session.step()
    lag = model.lag[:6] * plan.velocity  # what the damping of the gears holds back when they yield
    shapes = model.gear_shapes(plan.theta, plan.states)
    rows = plan.theta[None], plan.loads[None], np.zeros((1, 6)), shapes[None]
    error = pose_error(X_WE, model.predict(model.constants(x), x, *rows).X_WE[0])
    assert np.abs(lag).max() > 1e-4  # it moves
    assert np.abs(error[3:]).max() < 20e-6
    assert np.abs(error[:3]).max() < 50e-6


def test_it_begins_where_the_robot_stands_and_at_rest(model):
    session = Session(true_unknowns(model, 4), model)
    plan, _ = session.step()
    np.testing.assert_allclose(plan.theta, session.start, atol=1e-6)
    assert np.abs(plan.velocity).max() < 1e-3


def test_a_plan_that_is_lost_is_refused(model):
    session = Session(true_unknowns(model, 4), model)
    while session.time < 1.6:  # led onto the path
        session.step()
    X_WE = session.path.sample(session.time)[0]
    X_WE[:3, 3] += [2.0, 0.0, 0.0]  # no arm of 0.9 m gets there
    wanted = Wanted(X_WE, np.zeros(6), NO_MOTION)
    with pytest.raises(OutOfReachError, match="does not reach its path here"):
        session.planner.step(session.memory, (session.x, session.rate), wanted, session.time, PERIOD)


def test_velocities_and_accelerations_belong_to_the_positions():
    model = tip_model()  # waves of a gear are too short for differences over two periods
    session = Session(true_unknowns(model, 5), model)
    plans = []
    while session.time < 3.0:
        plans.append(session.step()[0])
    theta, v, a = (np.array([getattr(p, n) for p in plans]) for n in ("theta", "velocity", "acceleration"))
    moving = slice(400, None)  # after it has been led onto the path
    np.testing.assert_allclose(v[1:-1][moving], (theta[2:] - theta[:-2])[moving] / (2.0 * PERIOD), atol=1e-4)
    np.testing.assert_allclose(a[1:-1][moving], (v[2:] - v[:-2])[moving] / (2.0 * PERIOD), atol=2e-2)


def test_parameters_that_move_do_not_reach_the_loads(model):
    x = true_unknowns(model, 6)
    still, moving = Session(x, model), Session(x, model)
    moving.rate = 0.05 * model.sigma
    for _ in range(100):
        (one, _), (other, _) = still.step(), moving.step()
    np.testing.assert_allclose(one.motion, other.motion, atol=1e-9)
    np.testing.assert_allclose(one.loads, other.loads, atol=1e-4)
    assert np.abs(one.velocity - other.velocity).max() > 1e-4


@pytest.mark.parametrize("share", [0.0, 0.02, 0.05, 0.2])
def test_a_plan_does_not_jerk_while_parameters_are_led_in(share: float):
    """Learning by some of its spread in a second asks motors for no more than the path does."""
    model = tip_model()
    x = true_unknowns(model, 5)
    session = Session(x, model)
    session.rate, theta = share * model.sigma, []
    while session.time < 3.0:
        session.x = x + session.time * session.rate
        theta.append(session.step()[0].theta)
    accelerations = np.diff(theta, 2, axis=0)[400:] / PERIOD**2  # after it has been led onto the path
    assert np.abs(np.diff(accelerations, axis=0)).max() < 0.03  # rad/s^2 in a tick; 0.01 by the path


def test_what_turns_faster_takes_more_torque(model):
    # Without losses motors and gears have the same power: torque goes with the speed of joint for motor.
    x = true_unknowns(model, 3)
    session = Session(x, model)
    while session.time < 3.5:
        plan, _ = session.step()
    h = 1e-6  # rad, of a wave of a hundredth
    there, here = (
        model.gear_error(x, model.gear_shapes(plan.theta + side * h, plan.states)) for side in (1.0, -1.0)
    )
    ratios = 1.0 + (there - here) / (2.0 * h)
    assert np.abs(ratios - 1.0).max() > 1e-3
    np.testing.assert_allclose(plan.ratios, ratios, atol=2e-4)
    np.testing.assert_allclose(plan.on_motors, plan.loads[:, :6] * plan.ratios)
