"""Drive models and the motion of their motors, for tests."""

import numpy as np

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.estimation.drives.drive_config import DriveModelConfig
from systems.estimation.drives.drive_model import DriveModel

PERIOD = 4e-3
LOADS = np.zeros((5, 18))


def motion(time: float | np.ndarray):
    """Position, velocity and acceleration of six joints."""
    w, u = 2.0 + 0.4 * np.arange(6), 1.0 + np.arange(6)
    return 0.3 * np.sin(w * time + u), 0.3 * w * np.cos(w * time + u), -0.3 * w**2 * np.sin(w * time + u)


def drives(takes_torque=True, robot="irb1200", **config):
    belief = ControllerModel(load_robot(robot), 7.0, PERIOD, takes_torque=takes_torque)
    model = DriveModel(belief, DriveModelConfig(**config))
    memory = model.layout.view(np.zeros(model.layout.size))
    model.start(memory)
    return model, memory
