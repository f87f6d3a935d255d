"""Feedforward for a motion of one's own: what the motors must do so that the links of a KR 16 follow."""

import numpy as np

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.feedforward.config import FeedforwardConfig
from systems.feedforward.flexible_joint import FlexibleJointFeedforward
from systems.feedforward.joint_motion import JointReference

PERIOD = 0.004  # s, between two commands
DURATION = 1.2  # s
START, WAY = np.deg2rad([0.0, -80.0, 90.0, 0.0, 30.0, 0.0]), np.deg2rad([40.0, 15.0, -20.0, 0.0, 10.0, 60.0])

# From rest to rest with as many continuous derivatives as the model of the elastic gears takes.
share = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
model = ControllerModel(load_robot("kr16"), payload=16.0, period=PERIOD)
inverse = FlexibleJointFeedforward(model, FeedforwardConfig("flexible_joint"))
time = np.arange(0.0, DURATION, PERIOD)
references = [
    JointReference(
        START + WAY * share(t / DURATION),
        WAY * share.deriv(1)(t / DURATION) / DURATION,
        WAY * share.deriv(2)(t / DURATION) / DURATION**2,
    )
    for t in time
]
commands = inverse.play(references)  # (n, 3, 6): positions in rad, velocities in rad/s, torques in N m
links = np.array([reference.position for reference in references])
ahead = np.rad2deg(np.abs(commands[:, 0] - links).max(axis=0))
print("the motors turn farther than the links by up to", np.round(ahead, 3), "degrees")
print("torques beyond the weight of the arm up to", np.round(np.abs(commands[:, 2]).max(axis=0)), "N m")
