"""What the self-calibrating law learns of motors: a change in operation opens what it believes of them."""

import numpy as np

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.estimation.drives.drive_model import MASS
from systems.estimation.memory import Layout
from systems.servo.self_calibrating.config import SelfCalibratingConfig
from systems.servo.self_calibrating.learning import Learning

PERIOD = 4e-3
FAR = np.full(6, 1e-2)  # rad, further behind the plan than drives get on their own


def test_what_is_believed_is_opened_once_by_a_change_that_lasts():
    model = ControllerModel(load_robot("irb1200"), 7.0, PERIOD, elasticity="structure", takes_torque=True)
    learning = Learning(model, SelfCalibratingConfig())
    layout = Layout(**learning.arrays)
    memory = layout.view(np.zeros(layout.size))
    learning.start(memory)
    variance = []
    for k in range(round(0.9 / PERIOD)):
        learning.motors._learn_drives(memory, 1.0 + k * PERIOD, FAR)
        variance.append(memory.drives.P[MASS, MASS])
    steps = np.diff(variance)
    assert np.count_nonzero(steps > 1.0) == 1  # kg^2; motors that stand show nothing of the mass
    assert variance[-1] > 10.0 * variance[0]
