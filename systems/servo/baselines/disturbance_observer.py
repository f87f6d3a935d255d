"""A law that takes all that is wrong for a disturbance of the tip, observes it and leads the tip aside."""

import numpy as np

from robots.pose import pose_error
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.servo.law import LawInput, LawOutput, ServoLaw, integrate_twist
from systems.servo.law_config import LawConfig

_JOINTS = slice(0, 18)  # of the last tick
_CORRECTION = slice(18, 24)  # rad and m, rotation first
_DISTURBANCE = slice(24, 30)  # likewise, as the last exposure shows it


class DisturbanceObserver(ServoLaw):
    """Commands the path, displaced by what the tip is observed to be off.

    The tip is where it was commanded plus a disturbance. At an exposure the disturbance is the error that the
    camera sees plus the correction that was in force then, as believed delays say; a filter of first order
    with the gains as its bandwidths, of one over the period at most, makes the correction from it. Were the
    delays and the robot as believed, no bandwidth would be unstable. Where the delay is believed wrong by d
    seconds, a bandwidth below 1 / d is stable for certain (small gain), and not far beyond: with 15 / s and
    136 ms too little it swings. What changes is followed late by delays and filter.

    The memory holds the joints of the last tick, the correction, the disturbance as the last exposure shows
    it, and the corrections of the ticks before until the one that is in force.
    """

    title = "Disturbance observer"
    colour = "#a16207"
    awaits_joints = False

    def __init__(self, model: ControllerModel, config: LawConfig, guard: GuardConfig) -> None:
        """Checks the configuration. Raises ValueError as `ServoLaw`."""
        late = round((model.camera_delay + model.command_delay) / model.period)
        self.memory_size = _DISTURBANCE.stop + 6 * (late + 1)
        super().__init__(model, config, guard)
        # With these a tick makes up for all that is observed; with twice as much it would go on to and fro.
        self._bandwidths = np.minimum(self.gains, 1.0 / model.period)

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """At the measured positions, at rest, nothing observed."""
        return np.concatenate([moment.position, np.zeros(self.memory_size - 6)])

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """The joints for the displaced pose."""
        correction, disturbance, rate = memory[_CORRECTION], memory[_DISTURBANCE], np.zeros(6)
        if moment.measured is not None:
            if moment.is_new:  # later ticks have the same image, but another correction is in force
                disturbance = pose_error(*moment.measured) + memory[-6:]
            wish = self._bandwidths * (disturbance - correction)
            rate = self.within_limits(wish, correction)
        correction = correction + self.period * rate
        X = integrate_twist(moment.X_WD, correction)
        joints = self.joints_at(X, moment.V_WD + rate, memory[_JOINTS])
        past = memory[_DISTURBANCE.stop : -6]
        memory = np.concatenate([joints, correction, disturbance, correction, past])
        return LawOutput(joints[:6], joints[6:12], correction, memory)
