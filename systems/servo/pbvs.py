"""Position-based visual servoing: joint velocities from the difference of the poses in Euler angles."""

import math
from dataclasses import dataclass

import numpy as np

from robots.configuration.quantity import quantity
from systems.servo.law import LawInput, LawOutput, ServoLaw, check_step
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
        config, kinematics, kernels = self.config, self.kinematics, self.kernels
        nominal = kinematics.rows_and_jacobian(memory)
        reached = kinematics.rows_and_jacobian(moment.position)
        q_d, velocity, correction = np.empty(6), np.empty(6), np.empty(6)
        step = kernels.pbvs(
            moment.X_WD,
            moment.V_WD,
            *(moment.measured or (moment.X_WD, moment.X_WD)),
            moment.measured is not None,
            nominal,
            reached,
            memory,
            moment.position,
            (config.rotation, config.translation),
            (self.angle_limit, config.correction_limit, math.radians(config.correction_speed_limit_deg_s)),
            self.period,
            q_d,
            velocity,
            correction,
        )
        check_step(step)
        return LawOutput(moment.position + self.period * velocity, velocity, correction, q_d)
