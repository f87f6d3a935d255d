"""Geometric compensation: the path in joint positions of the robot as it is, without a camera."""

from dataclasses import dataclass

import numpy as np

from robots.kinematics.forward import robust_solve
from systems.servo.law import LawInput, LawOutput, ServoLaw
from systems.servo.law_config import LawConfig


@dataclass
class CompensationConfig(LawConfig):
    """Its gains."""


class Compensation(ServoLaw):
    """Integrates dq/dt = J^+ L^-1 (L^T V_d + K e-bar), Probst (2024) eq. (4.14) with the corrected L.

    The error e-bar is that of the calibrated kinematics at the integrated positions, so that the integration
    does not drift, and the robust inverse carries it through singular poses. `OpenLoop` finds the same
    positions by Newton's method from the analytic inverse and needs no gain; with a calibrated robot it is
    the other compensation.

    The memory holds the positions and their last velocity (trapezoidal rule).
    """

    title = "Compensation"
    colour = "#b89400"
    Config = CompensationConfig
    uses_camera = False
    awaits_joints = False
    memory_size = 12

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """At the measured positions, at rest."""
        return np.concatenate([moment.position, np.zeros(6)])

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """One step of the trapezoidal rule."""
        q, last_velocity = memory[:6], memory[6:]
        # The wanted pose is that of this tick, so the error is taken where the positions will be by then.
        rows, J = self.kinematics.rows_and_jacobian(q + self.period * last_velocity)
        gains = self.config.rotation, self.config.translation
        feedback = self.kernels.sine_feedback(moment.X_WD, rows, moment.V_WD, *gains)
        velocity = robust_solve(J, moment.V_WD + feedback)
        q = q + 0.5 * self.period * (velocity + last_velocity)
        return LawOutput(q, velocity, np.zeros(6), np.concatenate([q, velocity]))
