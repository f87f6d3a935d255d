"""The baseline: the path through the nominal inverse kinematics, blind to the camera."""

from dataclasses import dataclass

import numpy as np

from systems.servo.law import LawInput, LawOutput, ServoLaw
from systems.servo.law_config import LawConfig


@dataclass
class OpenLoopConfig(LawConfig):
    """Its drive and limits."""


class OpenLoop(ServoLaw):
    """Commands the joint positions at which a perfect robot would be on the path.

    The memory holds the joints of the last tick.
    """

    title = "Open loop"
    colour = "#8a8f98"
    Config = OpenLoopConfig
    uses_camera = False
    awaits_joints = False
    is_compared = True
    memory_size = 18

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """At the measured positions, at rest."""
        return np.concatenate([moment.position, np.zeros(12)])

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """The joints for the wanted pose."""
        joints = self.joints_at(moment.X_WD, moment.V_WD, memory)
        return LawOutput(joints[:6], joints[6:12], np.zeros(6), joints)
