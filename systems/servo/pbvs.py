"""Position-based visual servoing: joint velocities from the difference of the poses in Euler angles."""

import math
from dataclasses import dataclass

import numpy as np

from robots.configuration.quantity import quantity
from robots.pose import angular_velocity, euler_difference, zyx_angles
from systems.servo.law import LawInput, LawOutput, ServoLaw, check_branch_continuity
from systems.servo.law_config import LawConfig


@dataclass
class PbvsConfig(LawConfig):
    """Its gains, and how fast it corrects."""

    # The largest correction of one joint
    correction_speed_limit_deg_s: float = quantity(30.0, 0.01, 1000.0, "deg/s")


class Pbvs(ServoLaw):
    """Commands dq/dt = J^+(q_d) V_d + J^+(q) T(z) K (z_d - z_m), Probst (2024) eq. (5.14).

    Corrected: every angle difference is wrapped to (-180, 180] degrees, because alpha runs through 180
    degrees at both ends of the path; without that the source keeps a static error of 6 degrees.

    The correcting joint velocity is limited, and so is the correction that it adds up to. The memory holds
    q_d, the nominal joint positions on the path, carried on by their velocity and one Newton step a tick.
    """

    title = "PBVS"
    colour = "#d55e00"
    Config = PbvsConfig
    config: PbvsConfig
    commands_motors = True
    is_compared = True

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """A velocity along the path and towards it, from where the joints are."""
        rows, J = self.kinematics.rows_and_jacobian(memory)
        rates = self.kernels.follow_path(moment.X_WD, moment.V_WD, rows, J)
        check_branch_continuity(rates[:, 0])
        if self.kernels.closeness(J) > 0.0:
            rates = self.kernels.bounded_path(moment.X_WD, moment.V_WD, rows, J)
        velocity = rates[:, 1]
        q_d = memory + rates[:, 0] + self.period * velocity
        rows, J = self.kinematics.rows_and_jacobian(moment.position)
        correction = np.empty(6)
        self.kernels.error(rows, moment.X_WD, correction)
        if moment.measured is not None:
            twist = self.within_limits(self._feedback(*moment.measured), correction)
            if self.kernels.closeness(J) > 0.0:
                back = self.config.translation * (memory - moment.position)
                added = self.kernels.bounded_rates(J, twist, back)
            else:
                added = self.kernels.robust_solve(J, twist[:, None])[:, 0]
            fastest = math.radians(self.config.correction_speed_limit_deg_s)
            largest = max(map(abs, added.tolist()))
            velocity = velocity + added * min(1.0, fastest / max(largest, 1e-12))
        return LawOutput(moment.position + self.period * velocity, velocity, correction, q_d)

    def _feedback(self, wanted: np.ndarray, seen: np.ndarray) -> np.ndarray:
        zyx = zyx_angles(seen.tolist())
        w = angular_velocity(zyx, euler_difference(zyx_angles(wanted.tolist()), zyx))
        twist = np.empty(6)
        twist[:3], twist[3:] = w, wanted[:, 3] - seen[:, 3]
        return self.gains * twist
