"""Rigid inverse dynamics as feedforward: the torque of a robot that does not bend."""

import numpy as np

from systems.feedforward.feedforward import Feedforward
from systems.feedforward.joint_motion import Drive, JointReference


class RigidFeedforward(Feedforward):
    """Motors and links move alike; the torque is that of inverse dynamics with friction."""

    title = "rigid"
    colour = "#c0392b"

    def drive_under(self, reference: JointReference, load: np.ndarray, memory: np.ndarray) -> Drive:
        """Motors that turn as their links."""
        zero = np.zeros_like(load)
        torque = self.motor_torque(reference.velocity, reference.acceleration, load)
        return Drive(zero, zero, torque, memory)
