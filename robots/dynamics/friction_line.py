"""The friction of motors as a straight line with a jump, for models that know no more of it."""

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel


def friction_line(robot: RobotModel) -> tuple[np.ndarray, np.ndarray]:
    """Coulomb friction in N m and viscous friction in N m s/rad, joint side, (6,) each.

    Where the file has drive trains with parts it is the line through their curve at 0.5 and 1 rad/s.
    """
    if robot.drive_trains is None:
        return robot.joint_coulomb_friction, robot.joint_viscous_friction
    no_load, one = np.zeros(NUM_JOINTS), np.ones(NUM_JOINTS)
    half, whole = (robot.drive_trains.losses(no_load, speed * one) for speed in (0.5, 1.0))
    return 2.0 * half - whole, 2.0 * (whole - half)
