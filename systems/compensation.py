"""Geometric compensation: the path in joint positions of the robot as it is, without a camera."""

import math

import numpy as np

from robots.kinematics import robust_solve
from robots.pose import sine_pose_error
from systems.servo.law import Moment, ServoLaw, Step

_SMALLEST_COSINE = math.cos(math.radians(60.0))  # L is singular at 90 degrees


class Compensation(ServoLaw):
    """Integrates dq/dt = J^+ L^-1 (L^T V_d + K e-bar), Probst (2024) eq. (4.14) with the corrected L.

    The error e-bar is that of the calibrated kinematics at the integrated positions, so that the integration
    does not drift, and the robust inverse carries it through singular poses. `OpenLoop` finds the same
    positions by Newton's method from the analytic inverse and needs no gain; with a calibrated robot it is
    the other compensation.

    L^-1 L^T w = (R R_d^T) w and L^-1 e-bar = e-bar / cos(angle) in closed form. The memory holds the
    positions and their last velocity (trapezoidal rule).
    """

    memory_size = 12

    def _start(self, moment: Moment) -> np.ndarray:
        return np.concatenate([moment.position, np.zeros(6)])

    def _step(self, moment: Moment, memory: np.ndarray) -> Step:
        q, last_velocity = memory[:6], memory[6:]
        # The wanted pose is that of this tick, so the error is taken where the positions will be by then.
        X_WE, J = self._kinematics.forward_and_jacobian(q + self.period * last_velocity)
        relative = X_WE[:3, :3] @ moment.X_WD[:, :3].T
        cosine = 0.5 * (float(np.trace(relative)) - 1.0)
        twist = self._gains * sine_pose_error(moment.X_WD, X_WE)
        if cosine > _SMALLEST_COSINE:
            twist[:3] /= cosine
            twist[:3] += relative @ moment.V_WD[:3]
        else:
            twist[:3] += moment.V_WD[:3]
        twist[3:] += moment.V_WD[3:]
        velocity = robust_solve(J, twist)
        q = q + 0.5 * self.period * (velocity + last_velocity)
        return Step(q, velocity, np.zeros(6), np.concatenate([q, velocity]))
