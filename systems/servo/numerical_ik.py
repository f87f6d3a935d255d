"""Numerical inverse kinematics closed over the camera: joint velocities from the pose error, integrated."""

from dataclasses import dataclass

import numpy as np

from robots.kinematics.forward import robust_solve
from robots.pose import error_of_rows
from systems.servo.law import LawInput, LawOutput, ServoLaw
from systems.servo.law_config import LawConfig
from systems.servo.sine_feedback import sine_feedback


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
            feedback = sine_feedback(*moment.measured, moment.V_WD, *gains)
            added = self.within_limits(feedback, correction.tolist())
            twist = [wanted + more for wanted, more in zip(twist, added, strict=True)]
        # Columns that LAPACK need not copy.
        rates = robust_solve(J, np.array((error_of_rows(moment.X_WD, rows), twist)).T)
        velocity = rates[:, 1]
        q = q + 0.5 * self.period * (velocity + last_velocity)
        following = np.empty(18)
        following[:6], following[6:12], following[12:] = halfway + rates[:, 0], q, velocity
        return LawOutput(q, velocity, correction, following)
