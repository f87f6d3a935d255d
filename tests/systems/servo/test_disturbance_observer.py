"""The disturbance observer where delays and robot are as believed: what is constant is made up for."""

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.servo.baselines.disturbance_observer import DisturbanceObserver
from systems.servo.law import LawInput, integrate_twist
from systems.servo.law_config import LawConfig

PERIOD, Q = 4e-3, np.array([0.1, 0.3, 0.2, 0.1, 0.9, 0.0])
DISTURBANCE = np.array([1e-3, 0.0, -1e-3, 2e-3, -1e-3, 1e-3])


@pytest.mark.parametrize("gain", [20.0, 100.0, 250.0, 600.0, 1000.0])
@pytest.mark.parametrize("late", [1, 6])
def test_no_bandwidth_is_unstable(gain: float, late: int):
    robot = load_robot("irb1200")
    model = ControllerModel(robot, 0.0, PERIOD, camera_delay=PERIOD, command_delay=(late - 1) * PERIOD)
    law = DisturbanceObserver(model, LawConfig(translation=gain, rotation=gain), GuardConfig())
    X_WD = Kinematics(robot).forward(Q)[:3]
    memory = law.initial_state(LawInput(X_WD, np.zeros(6), Q, None))
    commanded = [np.zeros(6)] * (late + 1)
    for _ in range(200):
        seen = integrate_twist(X_WD, commanded[-late - 1] + DISTURBANCE)
        answer = law.step(LawInput(X_WD, np.zeros(6), Q, (X_WD, seen)), memory)
        memory = answer.memory
        commanded.append(answer.correction)
    assert commanded[-1] == pytest.approx(-DISTURBANCE, abs=1e-8)
