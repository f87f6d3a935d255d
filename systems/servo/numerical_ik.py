"""Numerical inverse kinematics closed over the camera: joint velocities from the pose error, integrated."""

from dataclasses import dataclass

import numpy as np

from systems.servo.law import LawInput, LawOutput, ServoLaw
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
    their last velocity (trapezoidal rule).
    """

    title = "Numerical IK"
    colour = "#0f7cc0"
    Config = NumericalIkConfig
    awaits_joints = False
    is_compared = True
    memory_size = 18

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """Both at the measured positions, at rest."""
        return np.concatenate([moment.position, moment.position, np.zeros(6)])

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """One step of the trapezoidal rule, with feedback of the pose error where there is a sample."""
        q_d, q, last_velocity = memory[:6], memory[6:12], memory[12:]
        # Where both will be at this tick, to which the wanted pose and twist belong.
        halfway = 0.5 * (q + q_d) + self.period * last_velocity
        rows, J = self.kinematics.rows_and_jacobian(halfway)
        correction = J.dot(q - q_d)
        twist = moment.V_WD
        if moment.measured is not None:
            gains = self.config.rotation, self.config.translation
            feedback = self.kernels.sine_feedback(*moment.measured, twist, *gains)
            twist = twist + self.within_limits(feedback, correction)
        following = self.kernels.numerical_ik(moment.X_WD, twist, rows, J, halfway, memory, self.period)
        return LawOutput(following[6:12], following[12:], correction, following)
