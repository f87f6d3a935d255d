"""The error system on position level: the wanted pose, shifted by the integral of its error."""

import math

import numpy as np

from robots.kinematics import robust_solve
from robots.pose import angular_velocity, euler_difference, euler_rates, rotation_from_zyx, zyx_from_rotation
from systems.servo.law import Moment, ServoLaw, Step, followed_branch


class PositionLevel(ServoLaw):
    """Commands q(z_d + c) with dc/dt = K (z_d - z_m), Probst (2024) eqs. (5.18), (5.19).

    Corrected: c starts at minus the initial error, so that the first command is where the robot stands
    (the source adds the error and jumps by twice of it), and Euler angle differences are wrapped.
    The initial error is taken from the nominal kinematics, because that is what makes the start smooth
    also for a robot whose geometry is wrong. The correction is limited.

    The memory holds c (Euler angles alpha, beta, gamma in rad, then the position in m) and the last joint
    positions, which choose the branch.
    """

    memory_size = 12

    def _start(self, moment: Moment) -> np.ndarray:
        X_WE = self._kinematics.forward(moment.position)[:3]
        return np.concatenate([_euler_difference(X_WE, moment.X_WD), moment.position])

    def _step(self, moment: Moment, memory: np.ndarray) -> Step:
        c, q = memory[:6], memory[6:]
        rate = np.zeros(6)
        if moment.measured is not None:
            rate = self._gains * _euler_difference(*moment.measured)
        c = c + self.period * rate
        for part, limit in ((c[:3], self._angle_limit), (c[3:], self.config.correction_limit)):
            size_squared = part @ part
            if size_squared > limit * limit:
                part *= limit / math.sqrt(size_squared)

        wanted_zyx = zyx_from_rotation(moment.X_WD[:, :3])
        zyx = wanted_zyx + c[:3]
        X_WC = np.empty((3, 4))
        X_WC[:, :3] = rotation_from_zyx(zyx)
        X_WC[:, 3] = moment.X_WD[:, 3] + c[3:]
        q = followed_branch(self._inverse, X_WC, q)
        correction = np.concatenate([angular_velocity(zyx, c[:3]), c[3:]])
        V = moment.V_WD + rate
        V[:3] = angular_velocity(zyx, rate[:3] + euler_rates(wanted_zyx, moment.V_WD[:3]))
        velocity = robust_solve(self._kinematics.jacobian(q), V)
        return Step(q, velocity, correction, np.concatenate([c, q]))


def _euler_difference(X_WD: np.ndarray, X_WE: np.ndarray) -> np.ndarray:
    """z_d - z with wrapped angles (alpha, beta, gamma) in rad, then the position in m, eq. (5.10)."""
    difference = np.empty(6)
    difference[:3] = euler_difference(zyx_from_rotation(X_WD[:, :3]), zyx_from_rotation(X_WE[:, :3]))
    difference[3:] = X_WD[:, 3] - X_WE[:, 3]
    return difference
