"""Compensation without a camera: both ways lead the true tool of a calibrated robot along the path."""

import numpy as np
import pytest

from robots.description.error_parameters import NUM_PARAMETERS
from robots.description.model import RobotModel, load_robot
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.reference.paths import ReferenceConfig, make_path
from systems.servo import LAWS, LawConfig
from systems.servo.law import LawInput

PERIOD = 4e-3
HOME = np.deg2rad([0.0, 30.0, 20.0, 0.0, 40.0, 0.0])
PATH = make_path(ReferenceConfig())


def calibrated() -> RobotModel:
    rng = np.random.default_rng(0)
    return ErrorKinematics(load_robot("irb1200")).robot_with_errors(0.005 * rng.normal(size=NUM_PARAMETERS))


def commanded(law: str, robot: RobotModel, offset: float = 0.0, gain: float = 5.0) -> np.ndarray:
    """Errors of the calibrated robot's tool at the commanded positions along the path, (n, 6)."""
    config = LawConfig(translation=gain, rotation=gain)
    system = LAWS[law](ControllerModel(robot, period=PERIOD), config, GuardConfig())
    times = np.arange(0.0, PATH.duration, PERIOD)
    X, V, _ = PATH.sample(times)
    start = inverse_kinematics(robot).nearest(X[0], HOME) + offset
    memory, positions = None, []
    for X_WD, V_WD in zip(X, V, strict=True):
        moment = LawInput(X_WD[:3], V_WD, start, None)
        memory = system.initial_state(moment) if memory is None else memory
        step = system.step(moment, memory)
        memory = step.memory
        positions.append(step.position)
    return pose_error(X, Kinematics(robot).forward(np.array(positions)))


def test_newton_meets_the_path_to_rounding():
    assert np.abs(commanded("open_loop", calibrated())).max() < 1e-12


@pytest.mark.parametrize("gain", [2.0, 20.0])
def test_the_integrated_law_follows_within_its_step_and_does_not_drift(gain: float):
    """The trapezoidal rule errs by T^2 / 12 times the third derivative; feedback keeps it from adding up."""
    errors = commanded("compensation", calibrated(), gain=gain)
    assert np.abs(errors).max() < 2e-5
    assert np.abs(errors[-1]).max() < 1e-7  # after a dwell of 2 s, four time constants of the smaller gain


def test_a_wrong_start_is_forgotten_with_the_time_constant_of_the_gain():
    errors = commanded("compensation", calibrated(), offset=0.01, gain=5.0)
    size = np.linalg.norm(errors[:, 3:], axis=1)
    after = round(0.2 / PERIOD)  # one time constant
    assert size[after] / size[0] == pytest.approx(np.exp(-1.0), rel=0.05)
