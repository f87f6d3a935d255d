"""The error system on position level: the wanted pose, shifted by the integral of its error."""

import math

import numpy as np

from robots.pose import angular_velocity, euler_difference, euler_rates, rotation_from_zyx, zyx_angles
from systems.servo.law import Moment, ServoLaw, Step


class PositionLevel(ServoLaw):
    """Commands q(z_d + c) with dc/dt = K (z_d - z_m), Probst (2024) eqs. (5.18), (5.19).

    Corrected: c starts at minus the initial error, so that the first command is where the robot stands
    (the source adds the error and jumps by twice of it), and Euler angle differences are wrapped.
    The initial error is taken from the nominal kinematics, because that is what makes the start smooth
    also for a robot whose geometry is wrong. The correction is limited.

    The memory holds c (Euler angles alpha, beta, gamma in rad, then the position in m) and the joints of the
    last tick.
    """

    memory_size = 24

    def _start(self, moment: Moment) -> np.ndarray:
        X_WE = self._kinematics.forward(moment.position)[:3]
        return np.concatenate([_euler_difference(X_WE, moment.X_WD), moment.position, np.zeros(12)])

    def _step(self, moment: Moment, memory: np.ndarray) -> Step:
        rate = np.zeros(6)
        if moment.measured is not None:
            rate = self._gains * _euler_difference(*moment.measured)
        c = self._limited(memory[:6] + self.period * rate)
        turn, shift = c[:3], c[3:]

        rows = moment.X_WD.tolist()
        wanted_zyx = zyx_angles(rows)
        zyx = [a + b for a, b in zip(wanted_zyx, turn, strict=True)]
        X_WC = np.empty((3, 4))
        X_WC[:, :3] = rotation_from_zyx(np.array(zyx))
        X_WC[:, 3] = [row[3] + way for row, way in zip(rows, shift, strict=True)]

        *wanted_w, x, y, z = moment.V_WD.tolist()
        *turning, dx, dy, dz = rate.tolist()
        zyx_rates = [a + b for a, b in zip(turning, euler_rates(wanted_zyx, wanted_w), strict=True)]
        V = np.array([*angular_velocity(zyx, zyx_rates), x + dx, y + dy, z + dz])
        joints = self._joints_at(X_WC, V, memory[6:])
        correction = np.array([*angular_velocity(zyx, turn), *shift])
        return Step(joints[:6], joints[6:12], correction, np.concatenate([c, joints]))

    def _limited(self, correction: np.ndarray) -> list[float]:
        """A correction, angle and length cut to their limits."""
        limited = []
        for part, limit in (
            (correction[:3].tolist(), self._angle_limit),
            (correction[3:].tolist(), self.config.correction_limit),
        ):
            size = math.hypot(*part)
            limited += part if size <= limit else [limit / size * value for value in part]
        return limited


def _euler_difference(X_WD: np.ndarray, X_WE: np.ndarray) -> np.ndarray:
    """z_d - z with wrapped angles (alpha, beta, gamma) in rad, then the position in m, eq. (5.10)."""
    wanted, seen = X_WD.tolist(), X_WE.tolist()
    angles = euler_difference(zyx_angles(wanted), zyx_angles(seen))
    return np.array([*angles, *(a[3] - b[3] for a, b in zip(wanted, seen, strict=True))])
