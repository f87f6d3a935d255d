"""Numerical inverse kinematics closed over the camera: joint velocities from the pose error, integrated."""

from dataclasses import dataclass

import numpy as np

from systems.servo.law import LawInput, LawOutput, ServoLaw, check_branch_continuity, check_step
from systems.servo.law_config import LawConfig


@dataclass
class NumericalIkConfig(LawConfig):
    """Its gains."""


class NumericalIk(ServoLaw):
    """Integrates dq/dt = J^+ L^-1 (L^T V_d + K e-bar), Probst (2024) eq. (5.8) with the corrected L.

    The Jacobian is taken halfway between the commanded positions and those of the nominal robot on the path,
    q_d. If the robot is wrong by its tool, the true Jacobian is that of the former, if it is wrong by joint
    offsets, that of the latter.

    The memory holds q_d, found from the halfway point by one Newton step, then the commanded positions and
    their last velocity (trapezoidal rule), then the point halfway where both will be at the next tick.
    """

    title = "Numerical IK"
    colour = "#0f7cc0"
    Config = NumericalIkConfig
    awaits_joints = False
    is_compared = True
    memory_size = 24

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """All at the measured positions, at rest."""
        position = moment.position
        return np.concatenate([position, position, np.zeros(6), position])

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """One step of the trapezoidal rule, with feedback of the pose error where there is a sample."""
        config, kinematics, kernels = self.config, self.kinematics, self.kernels
        commanded = kinematics.rows_and_jacobian(memory[6:12])
        follow, places = kernels.numerical_ik, kinematics.rows_and_jacobian(memory[18:])
        closeness = kernels.closeness(commanded[1])
        if closeness > 0.0:
            follow = kernels.numerical_ik_at_singularity
            nominal = kinematics.rows_and_jacobian(memory[:6])
            check_branch_continuity(kernels.follow_path(moment.X_WD, moment.V_WD, *nominal)[:, 0])
            places = nominal, commanded, places[1], closeness
        following, correction = np.empty(24), np.empty(6)
        step = follow(
            moment.X_WD,
            moment.V_WD,
            *(moment.measured or (moment.X_WD, moment.X_WD)),
            moment.measured is not None,
            *places,
            memory,
            (config.rotation, config.translation),
            (self.angle_limit, config.correction_limit),
            self.period,
            following,
            correction,
        )
        check_step(step)
        return LawOutput(following[6:12], following[12:18], correction, following)
