"""A station whose robot has drive trains with parts: the same equations, at rest, reproducible."""

import numpy as np
import pytest

from diagrams.record.log import RunLog
from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from robots.description.drive_parts import Tanh
from robots.description.model import RobotModel, load_robot

TIPS = (slice(None), slice(0, 3), 3)


def driven(robot: RobotModel, until: float, *settings: str) -> RunLog:
    scenario = load_scenario("misaligned", ["reference.settle=0.1", *settings])
    experiment = Experiment(scenario, "open_loop", robot)
    experiment.advance(until=until)
    return experiment.log()


@pytest.mark.slow
def test_a_friction_that_is_named_moves_the_robot_like_the_same_friction_in_the_drive_train():
    """The same equations in two systems, with the same steps."""
    plain, named = load_robot("irb1200"), load_robot("irb1200")
    for joint in named.joints:
        train = joint.drive_train
        viscous, coulomb = train.ratio**2 * train.viscous_friction, train.ratio * train.coulomb_friction
        train.friction = Tanh(viscous, coulomb, train.coulomb_velocity)
        train.viscous_friction = train.coulomb_friction = 0.0
    assert plain.drive_trains is None
    assert named.drive_trains is not None
    once, again = driven(plain, 1.0), driven(named, 1.0)
    moved = np.linalg.norm(np.ptp(once.X_WE_true[TIPS], axis=0))
    assert moved > 0.01  # m
    np.testing.assert_allclose(again.X_WE_true[TIPS], once.X_WE_true[TIPS], atol=1e-9)
    np.testing.assert_allclose(again.joint_effort, once.joint_effort, atol=1e-5)


@pytest.mark.slow
def test_a_realistic_robot_comes_to_rest_and_moves_the_same_every_time():
    robot = load_robot("irb1200-realistic")
    rest = ("reference.settle=2.5", "initial_error_mm=[0, 0, 0]")
    once, again = driven(robot, 2.4, *rest), driven(robot, 0.2, *rest)
    n = len(again.time)
    np.testing.assert_array_equal(once.X_WE_true[:n], again.X_WE_true)
    late = once.time > 2.0
    assert np.ptp(once.X_WE_true[late, :3, 3], axis=0).max() < 5e-6  # m, a gap under no load closes slowly
    assert np.ptp(once.joint_effort[late], axis=0).max() < 0.2  # N m


@pytest.mark.slow
def test_teeth_that_lie_free_cost_few_steps():
    """Without a load the wrist's teeth hardly touch; a damper that sets in with a jump took 440,000."""
    scenario = load_scenario("everything-realistic", ["station.payload=0", "servo.model.payload=0"])
    experiment = Experiment(scenario, "self_calibrating", seed=0)
    experiment.advance(until=0.4)
    integrator = experiment.simulator.get_integrator()
    assert integrator.get_num_derivative_evaluations() < 60_000  # some 5,000 where no tooth meets another
