"""The baseline: the path through the nominal inverse kinematics, blind to the camera."""

import numpy as np

from robots.inverse_kinematics import InverseKinematics
from robots.kinematics import Kinematics, robust_solve
from robots.model import RobotModel
from systems.guard import GuardConfig
from systems.servo.law import LawConfig, Moment, ServoLaw, Step, followed_branch


class OpenLoop(ServoLaw):
    """Commands the joint positions at which a perfect robot would be on the path.

    The memory holds the last joint positions, which choose the branch.
    """

    memory_size = 6

    def __init__(self, robot: RobotModel, config: LawConfig, guard: GuardConfig, period: float, **options) -> None:
        super().__init__(robot, config, guard, period, **options)
        self._kinematics = Kinematics(robot)
        self._inverse = InverseKinematics(robot)

    def _start(self, moment: Moment) -> np.ndarray:
        return moment.position

    def _step(self, moment: Moment, memory: np.ndarray) -> Step:
        q = followed_branch(self._inverse, moment.X_WD, memory)
        velocity = robust_solve(self._kinematics.jacobian(q), moment.V_WD)
        return Step(q, velocity, np.zeros(6), q)
