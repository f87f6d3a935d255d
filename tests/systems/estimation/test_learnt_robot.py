"""What was learnt as a robot file, and such a file as what is known before."""

from pathlib import Path

import numpy as np
import pytest

from robots.calibration.error_model import ErrorModel
from robots.description.calibration import Calibration
from robots.description.model import load_robot
from robots.description.robot_file import robot_text
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.pose import pose_error
from systems.controller_model import ControllerModel
from systems.estimation.findings import calibrated_robot
from systems.estimation.learnt_robot import known_before
from systems.estimation.tip_estimator import TipEstimator
from systems.estimation.tip_estimator_config import TipEstimatorConfig
from systems.estimation.tip_model import Spread, TipModel
from tests.systems.estimation.arms import PERIOD, MovingArm, tip_model, true_unknowns


@pytest.fixture(scope="module")
def learnt():
    """An estimator that has seen two seconds of an arm."""
    model = tip_model()
    arm = MovingArm(model, true_unknowns(model, 0), 0)
    estimator = TipEstimator(model, TipEstimatorConfig())
    memory = estimator.layout.view(np.zeros(estimator.layout.size))
    estimator.start(memory)
    for k in range(200):
        estimator.add(memory, arm.pair(PERIOD * k))
        estimator.work(memory)
    return estimator, memory, arm


@pytest.fixture(scope="module")
def reread(learnt, tmp_path_factory) -> TipModel:
    """The model of a robot that was read from the file of what was learnt."""
    estimator, memory, _ = learnt
    file = Path(tmp_path_factory.mktemp("robot")) / "robot.yaml"
    file.write_text(robot_text(calibrated_robot(estimator, memory, "irb1200")))
    belief = ControllerModel(load_robot(str(file)), 7.0, PERIOD, elasticity="structure")
    return TipModel(belief, Spread())


def test_the_file_has_the_geometry_and_the_springs(learnt, reread):
    estimator, memory, arm = learnt
    x = reread.mean.copy()
    found = estimator.x(memory)
    x[reread.M], x[reread.C] = found[reread.M], found[reread.C]  # they are not the robot's
    for time in (0.3, 1.1, 7.0):
        pair = arm.pair(time, noise=0.0)
        rows = pair.theta[None], pair.loads[None], pair.twist[None]
        there = reread.predict(reread.constants(x), x, *rows).X_WE[0]
        here = estimator.predict(memory, pair).X_WE[0]
        # Between its constants the estimator is linear, within 0.1 mm and 0.1 mrad.
        np.testing.assert_allclose(pose_error(here, there), 0.0, atol=1e-6)


def test_who_starts_from_the_file_is_as_sure_as_who_wrote_it(learnt, reread):
    estimator, memory, arm = learnt
    robot = slice(0, reread.K.stop)
    before, after = np.linalg.inv(reread.prior), estimator.covariance(memory)
    nominal = tip_model()
    for time in (0.3, 1.1):
        pair = arm.pair(time, noise=0.0)
        rows = pair.theta[None], pair.loads[None], pair.twist[None]
        x = reread.mean
        H = reread.predict(reread.constants(x), x, *rows).H[0][:, robot]
        wrote = estimator.predict(memory, pair).H[0][:, robot]
        started = np.sqrt(np.diag(H @ before[robot, robot] @ H.T))
        ended = np.sqrt(np.diag(wrote @ after[robot, robot] @ wrote.T))
        unknown = nominal.predict(nominal.constants(nominal.mean), nominal.mean, *rows).H[0][:, robot]
        # About as sure, linearised elsewhere; a little less, as no robot stays as it was for ever.
        assert (started > 0.8 * ended).all()
        assert (started < 3.0 * ended).all()
        assert (started < 0.05 * np.linalg.norm(unknown, axis=1)).all()


def test_the_parameters_of_a_calibration_move_the_tip_as_they_do_here():
    robot, rng = load_robot("irb1200"), np.random.default_rng(0)
    model, chosen = ErrorModel(robot), TipModel(ControllerModel(robot), Spread()).chosen
    F = 1e-4 * rng.normal(size=(len(model), len(model)))
    rows = [row[: i + 1].tolist() for i, row in enumerate(F @ F.T)]
    names = list(model.names)
    robot.calibration = Calibration("irb1200", names=names, values=[0.0] * len(names), covariance=rows)
    known = known_before(robot, load_robot("irb1200"), chosen)
    assert known is not None
    g = len(chosen)
    q = rng.uniform(robot.lower, robot.upper, (4, 6))
    theirs = model.forward_and_regressor(q, np.zeros(len(model)))[1] @ F
    ours = ErrorKinematics(robot).regressor(q, np.zeros(48))[..., chosen]
    P = ours @ known[0][:g, :g] @ ours.swapaxes(1, 2)
    np.testing.assert_allclose(P, theirs @ theirs.swapaxes(1, 2), atol=1e-9 * np.abs(P).max())
    assert known[1].tolist() == [True] * g + [False] * 18
