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
    assert _corrections(gain, late)[-1] == pytest.approx(-DISTURBANCE, abs=1e-8)


@pytest.mark.parametrize("every", [3, 8])
def test_a_camera_slower_than_the_ticks_shows_the_same_disturbance(every: int):
    """What is constant is filtered alike, from whichever images it is known."""
    slow, quick = _corrections(40.0, late=4, every=every), _corrections(40.0, late=4)
    assert slow == pytest.approx(quick, abs=1e-8)


def _corrections(gain: float, late: int, every: int = 1) -> np.ndarray:
    """The corrections (n, 6) of a law that is right in its delays, with an image in so many ticks."""
    robot = load_robot("irb1200")
    model = ControllerModel(robot, 0.0, PERIOD, camera_delay=PERIOD, command_delay=(late - 1) * PERIOD)
    law = DisturbanceObserver(model, LawConfig(translation=gain, rotation=gain), GuardConfig())
    X_WD = Kinematics(robot).forward(Q)[:3]
    memory = law.initial_state(LawInput(X_WD, np.zeros(6), Q, None))
    corrections, seen = [np.zeros(6)] * (late + 1), X_WD
    for tick in range(200):
        if tick % every == 0:
            seen = integrate_twist(X_WD, corrections[-late - 1] + DISTURBANCE)
        moment = LawInput(X_WD, np.zeros(6), Q, (X_WD, seen), is_new=tick % every == 0)
        answer = law.step(moment, memory)
        memory = answer.memory
        corrections.append(answer.correction)
    return np.array(corrections)
