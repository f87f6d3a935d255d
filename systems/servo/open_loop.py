"""The baseline: the path through the nominal inverse kinematics, blind to the camera."""

import numpy as np

from robots.kinematics import robust_solve
from systems.servo.law import Moment, ServoLaw, Step, followed_branch


class OpenLoop(ServoLaw):
    """Commands the joint positions at which a perfect robot would be on the path.

    The memory holds the last joint positions, which choose the branch.
    """

    def _step(self, moment: Moment, memory: np.ndarray) -> Step:
        q = followed_branch(self._inverse, moment.X_WD, memory)
        velocity = robust_solve(self._kinematics.jacobian(q), moment.V_WD)
        return Step(q, velocity, np.zeros(6), q)
