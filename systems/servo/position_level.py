"""The error system on position level: the wanted pose, shifted by the integral of its error."""

import math

import numpy as np

from robots.pose import Rows, angular_velocity, euler_difference, euler_rates, rotation_rows, zyx_angles
from systems.servo.law import LawInput, LawOutput, ServoLaw


class PositionLevel(ServoLaw):
    """Commands q(z_d + c) with dc/dt = K (z_d - z_m), Probst (2024) eqs. (5.18), (5.19).

    Corrected: c starts at minus the initial error, so that the first command is where the robot stands
    (the source adds the error and jumps by twice of it), and Euler angle differences are wrapped.
    The initial error is taken from the nominal kinematics, because that is what makes the start smooth
    also for a robot whose geometry is wrong. The correction is limited.

    The memory holds c (Euler angles alpha, beta, gamma in rad, then the position in m) and the joints of the
    last tick.
    """

    title = "Position level"
    colour = "#009e73"
    is_compared = True
    memory_size = 24

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """c at minus the initial error, the joints where they are measured."""
        rows, _ = self.kinematics.rows_and_jacobian(moment.position)
        return np.concatenate([_euler_difference(rows, moment.X_WD), moment.position, np.zeros(12)])

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """Integrates the correction and commands the joints for the corrected pose."""
        c, rate = memory[:6].tolist(), [0.0] * 6
        if moment.measured is not None:
            difference = _euler_difference(*moment.measured)
            rate = [gain * part for gain, part in zip(self.gains, difference, strict=True)]
        c = self._limited([part + self.period * speed for part, speed in zip(c, rate, strict=True)])
        turn, shift = c[:3], c[3:]

        wanted_zyx = zyx_angles(moment.X_WD)
        zyx = [a + b for a, b in zip(wanted_zyx, turn, strict=True)]
        X_WC = [
            (*axes, row[3] + way)
            for axes, row, way in zip(rotation_rows(zyx), moment.X_WD, shift, strict=True)
        ]
        *wanted_w, x, y, z = moment.V_WD
        *turning, dx, dy, dz = rate
        zyx_rates = [a + b for a, b in zip(turning, euler_rates(wanted_zyx, wanted_w), strict=True)]
        V_WC = (*angular_velocity(zyx, zyx_rates), x + dx, y + dy, z + dz)
        joints = self.joints_at(X_WC, V_WC, memory[6:])
        correction = np.array([*angular_velocity(zyx, turn), *shift])
        return LawOutput(joints[:6], joints[6:12], correction, np.concatenate([c, joints]))

    def _limited(self, correction: list[float]) -> list[float]:
        """A correction, angle and length cut to their limits."""
        limited = []
        for part, limit in (
            (correction[:3], self.angle_limit),
            (correction[3:], self.config.correction_limit),
        ):
            size = math.hypot(*part)
            limited += part if size <= limit else [limit / size * value for value in part]
        return limited


def _euler_difference(X_WD: Rows, X_WE: Rows) -> list[float]:
    """z_d - z with wrapped angles (alpha, beta, gamma) in rad, then the position in m, eq. (5.10)."""
    angles = euler_difference(zyx_angles(X_WD), zyx_angles(X_WE))
    return [*angles, *(wanted[3] - seen[3] for wanted, seen in zip(X_WD, X_WE, strict=True))]
