"""Numerical inverse kinematics closed over the camera: joint velocities from the pose error, integrated."""

import math

import numpy as np

from robots.kinematics import robust_solve
from robots.pose import pose_error
from systems.servo.law import Moment, ServoLaw, Step

_SMALLEST_COSINE = math.cos(math.radians(60.0))  # L is singular at 90 degrees


class NumericalIk(ServoLaw):
    """Integrates dq/dt = J^+ L^-1 (L^T V_d + K e-bar), Probst (2024) eq. (5.8) with the corrected L.

    The Jacobian is taken halfway between the commanded positions and those of the nominal robot on the path,
    q_d. If the robot is wrong by its tool, the true Jacobian is that of the former, if it is wrong by joint
    offsets, that of the latter. Beyond 60 degrees of orientation error L = I, which is its limit for small
    errors: the law then still turns the tool the shorter way round.

    The memory holds q_d, found from the halfway point by one Newton step, then the commanded positions and
    their last velocity (trapezoidal rule).
    """

    memory_size = 18

    def _start(self, moment: Moment) -> np.ndarray:
        return np.concatenate([moment.position, moment.position, np.zeros(6)])

    def _step(self, moment: Moment, memory: np.ndarray) -> Step:
        q_d, q, last_velocity = memory[:6], memory[6:12], memory[12:]
        # Where both will be at this tick, to which the wanted pose and twist belong.
        halfway = 0.5 * (q + q_d) + self.period * last_velocity
        X_WE, J = self._kinematics.forward_and_jacobian(halfway)
        correction = J @ (q - q_d)
        twists = np.empty((2, 6)).T  # columns that LAPACK need not copy
        twists[:, 0] = pose_error(moment.X_WD, X_WE)
        twists[:, 1] = moment.V_WD
        if moment.measured is not None:
            feedback = self._feedback(*moment.measured, moment.V_WD)
            twists[:, 1] += self._within_limits(feedback, correction)
        rates = robust_solve(J, twists)
        velocity = rates[:, 1]
        q = q + 0.5 * self.period * (velocity + last_velocity)
        following = np.empty(18)
        following[:6], following[6:12], following[12:] = halfway + rates[:, 0], q, velocity
        return Step(q, velocity, correction, following)

    def _feedback(self, wanted: np.ndarray, seen: np.ndarray, V_WD: np.ndarray) -> np.ndarray:
        """What the law adds to the wanted twist.

        L has the closed-form solutions L^-1 L^T w = (R R_d^T) w and L^-1 e-bar = e-bar / cos(angle).
        """
        relative = seen[:, :3] @ wanted[:, :3].T
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = relative.tolist()
        gain = 0.5 * self.config.rotation
        cosine = 0.5 * (xx + yy + zz - 1.0)
        twist = np.empty(6)
        if cosine > _SMALLEST_COSINE:
            gain /= cosine
            twist[:3] = relative @ V_WD[:3] - V_WD[:3]
        else:
            twist[:3] = 0.0
        twist[:3] += (gain * (yz - zy), gain * (zx - xz), gain * (xy - yx))
        twist[3:] = self.config.translation * (wanted[:, 3] - seen[:, 3])
        return twist
