"""What encoders show beyond all that was learnt of drives, fed back."""

import math
from types import SimpleNamespace

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.estimation.drives.drive_config import DriveModelConfig
from systems.estimation.drives.drive_model import DriveCommand
from systems.estimation.memory import Layout

_SHARE_OF_DELAY = 0.3  # of 1 / T with a delay T, as the largest gain
_LATE = 2  # periods, until what an encoder says is in a command
_HALF_A_STEP = math.sqrt(3.0)  # standard deviations of rounding: what a reading may be wrong by
_MOST = 2e-3  # rad, of the largest; what is more has other reasons than those of drives


class MotorFeedback:
    """Commands motors beside their plan for what they are off it, whatever the reason is.

    With a motor that is off by e the command is beside the plan by b, b' = k e - l b. A cascade follows b as
    it follows its plan, so the loop is k / (s + l) times a delay: as k is at most l, it is nowhere above one,
    and no dead time makes it unstable. Slow errors are halved, those of a drive's own time are less by more
    than that. An integral in place of the lag would leave none of them, but the drives have one already, and
    of two in a row motors creep to and fro in friction that sticks, further each time.
    """

    def __init__(self, config: DriveModelConfig, kind: str, has_shares: bool, period: float) -> None:
        """Takes its gain.

        Args:
            config: what is believed of the drives.
            kind: of the drives; those that follow positions alone ring, and those that follow speeds alone
                are brought back otherwise: of both nothing is fed back here.
            has_shares: whether there are motors of which something is fed back, ever.
            period: between commands, s.
        """
        # A lag of more than two over the period would grow from step to step.
        gain = min(config.feedback, 1.0 / period)
        self._gain = gain if kind == "cascade" else 0.0
        self.acts = self._gain > 0.0 and has_shares  # else it changes no command
        self._period = period
        self.layout = Layout(beside=(NUM_JOINTS,))  # rad

    def add(
        self,
        memory: SimpleNamespace,
        command: DriveCommand,
        off: np.ndarray,
        rounding: np.ndarray,
        shares: np.ndarray,
        delay: float,
    ) -> DriveCommand:
        """Goes on by a period; returns the command with what is fed back.

        Args:
            memory: of the layout; is renewed.
            command: what the drives are to be told without it.
            off: planned less actual positions as known last, rad, (6,), NaN where they are not known.
            rounding: standard deviation of these by steps of the encoders, rad, (6,).
            shares: of the gain, of each motor, (6,), `DriveModel.shares_fed_back`.
            delay: from a command to the motion of a motor, s.
        """
        gain = min(self._gain, _SHARE_OF_DELAY / (delay + _LATE * self._period))
        off = np.nan_to_num(off)
        # In proportion, as motors that are all late are on their way still.
        off *= _MOST / max(_MOST, float(np.abs(off).max()))
        off -= np.clip(off, -_HALF_A_STEP * rounding, _HALF_A_STEP * rounding)
        speed = gain * shares * off - self._gain * memory.beside
        memory.beside += self._period * speed
        return command._replace(
            position=command.position + memory.beside,
            velocity=command.velocity + speed,
            beside=command.beside + memory.beside,
        )
