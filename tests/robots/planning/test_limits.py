"""Limits of a motion: what a robot file says of torques, and what it does not."""

from dataclasses import replace

import numpy as np

from robots.description.model import load_robot
from robots.planning.limits import motion_limits


def test_torques_without_any_limit_are_named():
    limits = motion_limits(load_robot("kr16"))
    assert limits.unlimited_torques == []
    of_axis_1 = np.where(np.arange(6) == 0, limits.gear_torque, np.inf)
    limits = replace(limits, motor_torque=np.full(6, np.inf), gear_torque=of_axis_1)
    assert limits.unlimited_torques == ["motor torque"]
