"""The corrected inverse on its own: what it tells at rest, how it corrects, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from robots.description.drive_parts import Cubic
from robots.description.model import NUM_JOINTS, RobotModel, load_robot
from robots.dynamics.friction_line import friction_line
from robots.kinematics.forward import Kinematics
from systems.controller_model import ControllerModel
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig, JointReference
from systems.feedforward.corrected_inverse.corrected import CorrectedFeedforward
from systems.feedforward.elastic_structure import ElasticStructureFeedforward
from systems.feedforward.prefilter import PrefilterConfig
from systems.reference.cartesian_path import CartesianPath
from systems.reference.segment import line
from systems.reference.timing import TIMINGS, PolynomialProfile

PERIOD, SETTLE = 4e-3, 0.2
HOME = np.deg2rad([10.0, -60.0, 80.0, 0.0, 40.0, 0.0])
AXES = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
KIND = "corrected"


def swing(duration: float = 0.3, after: float = 0.3) -> list[JointReference]:
    """Five degrees of axes 1 to 3, from rest to rest."""
    profile = TIMINGS["polynomial"].lasting(duration, np.deg2rad(5.0))
    times = np.arange(0.0, SETTLE + duration + after, PERIOD)
    return [
        JointReference(HOME + AXES * s, AXES * rate, AXES * acceleration)
        for s, rate, acceleration in np.transpose(profile.at_times(times - SETTLE))
    ]


def believed(robot: RobotModel) -> ControllerModel:
    return ControllerModel(robot, robot.payload.largest_mass, PERIOD, elasticity="structure")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "left"), [("kr16-realistic", 0.75), ("kr210-realistic", 0.5), ("kr16", 0.5)]
)
def test_the_simulated_tip_comes_nearer_to_its_path(name: str, left: float):
    """Twice as near; with play less, for by where axis 1 may rest in it the tip is off before it moves."""
    model = CorrectedFeedforward(believed(load_robot(name)), FeedforwardConfig(KIND))
    model.play(swing())
    assert model.history[-1] < left * model.history[0]


@pytest.mark.slow
def test_before_the_motion_and_long_after_it_motors_rest():
    robot = load_robot("kr16-realistic")
    told = CorrectedFeedforward(believed(robot), FeedforwardConfig(KIND)).play(swing())
    first = ElasticStructureFeedforward(believed(robot), FeedforwardConfig()).play(swing())
    assert told.shape == first.shape
    begin = round((SETTLE - 0.1) / PERIOD)
    assert told[:begin] == pytest.approx(first[:begin], abs=1e-9), "as the approximate inverse has them"
    assert told[-1, 1] == pytest.approx(0.0, abs=1e-9)
    assert told[-1, 0] == pytest.approx(first[-1, 0], abs=5e-4), "by no more than play and hysteresis"
    coulomb, _ = friction_line(robot)
    assert (np.abs(told[-1, 2] - first[-1, 2]) < 0.05 * coulomb).all(), "what still rings is held by friction"


@pytest.mark.slow
def test_a_long_motion_is_corrected_in_windows():
    """One of 1.6 s needs a second one, up to whose end less is left as well; with play as above."""
    model = CorrectedFeedforward(believed(load_robot("kr16-realistic")), FeedforwardConfig(KIND))
    model.play(swing(duration=1.6))
    assert model.history[-1] < 0.75 * model.history[0]


def test_at_rest_it_tells_what_the_approximate_inverse_tells():
    still = [JointReference(HOME, np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS))] * 10
    robot = load_robot("kr16-realistic")
    told = CorrectedFeedforward(believed(robot), FeedforwardConfig(KIND)).play(still)
    assert np.array_equal(told, ElasticStructureFeedforward(believed(robot), FeedforwardConfig()).play(still))


def test_a_motion_that_takes_too_long_to_simulate_is_refused():
    model = CorrectedFeedforward(believed(load_robot("kr16")), FeedforwardConfig(KIND))
    with pytest.raises(ValueError, match=r"takes 1\d\.\d s, more than the 10 s that are simulated"):
        model.play(swing(duration=12.0))


def test_a_prefilter_is_refused():
    config = FeedforwardConfig(KIND, prefilter=PrefilterConfig("bessel"))
    with pytest.raises(ValueError, match=r"it takes a path as it is; prefilter\.kind must be none"):
        FEEDFORWARDS[KIND](believed(load_robot("kr16")), config)


def test_springs_that_stiffen_are_refused():
    robot = load_robot("kr16")
    first = robot.joints[0]
    train = replace(first.drive_train, stiffening=Cubic(gamma=1e12))
    stiffening = replace(robot, joints=[replace(first, drive_train=train), *robot.joints[1:]])
    with pytest.raises(ValueError, match="its forward model knows linear springs, play and one hysteresis"):
        FEEDFORWARDS[KIND](believed(stiffening), FeedforwardConfig(KIND))


class Unsimulated(CorrectedFeedforward):
    def play(self, references):
        return np.array([[each.position, each.velocity, np.zeros(NUM_JOINTS)] for each in references])


@pytest.mark.parametrize("preview", [0.0, 0.006, 0.012, 0.036, 0.06])
def test_it_is_on_the_path_as_much_ahead_as_it_is_looked_ahead(preview: float):
    model = replace(believed(load_robot("kr16-realistic")), preview=preview)
    forward = Kinematics(model.robot).forward
    start, end = (forward(HOME + turn * AXES) for turn in (0.0, 0.1))
    path = CartesianPath([line(start, end)], PolynomialProfile.lasting(1.0), SETTLE, 0.1, 0.0)
    inverse = Unsimulated(model, FeedforwardConfig(KIND))
    inverse.prepare(path, HOME)
    context = inverse.CreateDefaultContext()
    for time in (0.0, 0.4, 0.6, 0.8):
        context.SetTime(time)
        context.SetDiscreteState(inverse.EvalUniquePeriodicDiscreteUpdate(context))
        told = forward(inverse.GetOutputPort("position_command").Eval(context))
        assert told[:3, 3] == pytest.approx(path.sample(time + preview)[0][:3, 3], abs=1e-6)
