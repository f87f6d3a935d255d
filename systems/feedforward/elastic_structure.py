"""The approximate inverse of a robot whose gears, bearings and links yield."""

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.controller_model import ControllerModel
from systems.feedforward.arm_correction import CORRECTIONS, smoothly_limited
from systems.feedforward.backward_differences import HISTORY, at_rest, with_newest
from systems.feedforward.config import FeedforwardConfig
from systems.feedforward.deformed_arm import DeformedArm
from systems.feedforward.flexible_joint import FlexibleJointFeedforward
from systems.feedforward.joint_motion import Drive, JointReference
from systems.feedforward.sprung_deflection import SprungDeflection


class ElasticStructureFeedforward(FlexibleJointFeedforward):
    """Five steps a sub-step, Reiner (2010) figure 3.21; an exact inverse would not be stable.

    1. The torques in bearings and beams, as if nothing yielded (3.76).
    2. How far these yield to them (3.78).
    3. The turns of the joints that bring the tip of the deformed arm back (3.86), limited (3.71).
    4. The load of the gears in the deformed, corrected arm (3.91).
    5. The inverse of the gears under this load, as in `FlexibleJointFeedforward`.

    The rest is what masses along the arm move differently from those of a rigid arm; the tip does not.

    The memory holds that of the gears, then the section torques of the last sub-step, then deflections and
    corrections of the last three.
    """

    title = "elastic structure"
    colour = "#0f7cc0"
    derivatives = 4

    def __init__(self, model: ControllerModel, config: FeedforwardConfig) -> None:
        """Builds the models.

        Raises:
            ValueError: as `Feedforward`; also if nothing but gears yields, or the correction is unknown.
        """
        correction = config.correction
        if correction.method not in CORRECTIONS:
            raise ValueError(
                f"feedforward: correction.method must be one of {', '.join(CORRECTIONS)}, "
                f"got '{correction.method}'"
            )
        if not 0.0 < correction.limit_deg < np.inf:
            raise ValueError(
                f"feedforward: correction.limit_deg must be positive, got {correction.limit_deg} deg"
            )
        arm = DeformedArm(model.robot, model.payload)
        memory = arm.size + HISTORY * (arm.size + NUM_JOINTS)
        super().__init__(model, config, memory)
        self._arm, self._size = arm, arm.size
        share = 1.0 + config.stiffness_error
        stiffening = None if arm.stiffening is None else arm.stiffening.scaled(share)
        self._springs = SprungDeflection(share * arm.stiffness, share * arm.damping, self.substep, stiffening)
        self._correction = CORRECTIONS[correction.method](model.robot, self._arm)
        self._limit = np.deg2rad(correction.limit_deg)

    def drive(self, reference: JointReference, memory: np.ndarray) -> Drive:
        """What the motors shall do; see `Feedforward.drive`."""
        size, of_gears = self._size, memory[: self.memory_size]
        own = memory[len(of_gears) :]
        q = reference.position
        torque = self._inertia * self._arm.section_torques(reference)
        X_WE = self._arm.pose(q, np.zeros(size))
        if np.isnan(own[0]):
            deflection = self._springs.at_rest(torque)
            turn = self._turn(q, deflection, X_WE, self._turn(q, deflection, X_WE, np.zeros(NUM_JOINTS)))
            history = at_rest(np.concatenate([deflection, turn]))
        else:
            history = own[size:].reshape(HISTORY, size + NUM_JOINTS)
            deflection = self._springs.step(history[0, :size], own[:size], torque)
            turn = self._turn(q, deflection, X_WE, history[0, size:])
        newest = np.concatenate([deflection, turn])
        rate, acceleration = self._differences.derivatives(newest, history)
        corrected = JointReference(
            q + turn, reference.velocity + rate[size:], reference.acceleration + acceleration[size:]
        )
        structure = (deflection, rate[:size], acceleration[:size])
        load = self._inertia * self._arm.gear_load(corrected, structure)
        drive = self.drive_under(corrected, load, of_gears)
        history = with_newest(newest, history)
        return Drive(
            drive.deflection - turn,
            drive.deflection_rate - rate[size:],
            drive.torque,
            np.concatenate([drive.memory, torque, history.ravel()]),
        )

    def _turn(self, q: np.ndarray, deflection: np.ndarray, X_WE: np.ndarray, last: np.ndarray) -> np.ndarray:
        turn = self._correction.correction(q, deflection, X_WE, last)
        return smoothly_limited(turn, self._limit)
