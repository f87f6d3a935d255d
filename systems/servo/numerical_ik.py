"""Numerical inverse kinematics closed over the camera: joint velocities from the pose error, integrated."""

import math

import numpy as np

from robots.kinematics import Kinematics, robust_inverse
from robots.model import RobotModel
from robots.pose import pose_error, sine_error_rate_matrix, sine_pose_error
from systems.guard import GuardConfig
from systems.servo.law import LawConfig, Moment, ServoLaw, Step

_LARGEST_EXACT_ANGLE = math.radians(60.0)  # L is singular at 90 degrees


class NumericalIk(ServoLaw):
    """Integrates dq/dt = J^+ L^-1 (L^T V_d + K e-bar), Probst (2024) eq. (5.8) with the corrected L.

    The Jacobian is taken halfway between the commanded positions and those of the nominal robot on the path,
    q_d. If the robot is wrong by its tool, the true Jacobian is that of the former, if it is wrong by joint
    offsets, that of the latter. Beyond 60 degrees of orientation error L = I, which is its limit for small
    errors: the law then still turns the tool the shorter way round.

    The memory holds q_d, which follows the path by one Newton step a tick, then the commanded positions and
    their last velocity (trapezoidal rule).
    """

    memory_size = 18

    def __init__(self, robot: RobotModel, config: LawConfig, guard: GuardConfig, period: float, **options) -> None:
        super().__init__(robot, config, guard, period, **options)
        self._kinematics = Kinematics(robot)
        self._limits = (math.radians(config.correction_limit_deg), config.correction_limit)

    def _start(self, moment: Moment) -> np.ndarray:
        q_d = moment.position
        for _ in range(6):  # from 10 mm off, Newton's method is exact after three
            X_WE, J = self._kinematics.forward_and_jacobian(q_d)
            q_d = q_d + robust_inverse(J) @ pose_error(moment.X_WD, X_WE)
        return np.concatenate([q_d, moment.position, np.zeros(6)])

    def _step(self, moment: Moment, memory: np.ndarray) -> Step:
        q_d, q, last_velocity = memory[:6], memory[6:12], memory[12:]
        J = self._kinematics.jacobian(0.5 * (q + q_d))
        J_inverse = robust_inverse(J)
        q_d = q_d + J_inverse @ pose_error(moment.X_WD, self._kinematics.forward(q_d))
        correction = J @ (q - q_d)
        V = moment.V_WD
        if moment.measured is not None:
            V = V + self._feedback(*moment.measured, moment.V_WD, correction)
        velocity = J_inverse @ V
        q = q + 0.5 * self.period * (velocity + last_velocity)
        return Step(q, velocity, correction, np.concatenate([q_d, q, velocity]))

    def _feedback(
        self, wanted: np.ndarray, seen: np.ndarray, V_WD: np.ndarray, correction: np.ndarray
    ) -> np.ndarray:
        """What the law adds to the wanted twist."""
        error = sine_pose_error(wanted, seen)
        twist = np.empty(6)
        twist[3:] = self.config.translation * error[3:]
        L = sine_error_rate_matrix(wanted[:3, :3], seen[:3, :3])
        if 0.5 * (np.vdot(wanted[:3, :3], seen[:3, :3]) - 1.0) > math.cos(_LARGEST_EXACT_ANGLE):
            w = V_WD[:3]
            twist[:3] = np.linalg.solve(L, L.T @ w + self.config.rotation * error[:3]) - w
        else:
            twist[:3] = self.config.rotation * error[:3]
        for part, limit in ((slice(0, 3), self._limits[0]), (slice(3, 6), self._limits[1])):
            # At its limit the correction may only shrink.
            size = math.sqrt(float(correction[part] @ correction[part]))
            if size >= limit and float(correction[part] @ twist[part]) > 0.0:
                twist[part] = 0.0
        return twist
