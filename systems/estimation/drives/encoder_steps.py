"""How coarse the readings of encoders are, from the readings themselves."""

import math
from types import SimpleNamespace

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.estimation import kernels
from systems.estimation.memory import Layout

_ENOUGH = 4  # changes, of which the largest is a step
_WINDOW = 250  # readings, in which they come


class EncoderSteps:
    """The smallest change of a reading is one step of its encoder, if it comes again soon.

    A reading that is disturbed once says nothing: only a few changes that are smaller than the step so far
    make it smaller.

    A reading is wrong by up to half a step: evenly distributed, with the standard deviation step / sqrt(12).
    Encoders without visible steps change by as little as one likes when the robot begins to move.
    """

    layout = Layout(
        last=(NUM_JOINTS,),
        step=(NUM_JOINTS,),
        smaller=(NUM_JOINTS,),  # the largest of the changes that were smaller
        count=(NUM_JOINTS,),  # of these
        age=(NUM_JOINTS,),  # readings since the first of them
    )

    @staticmethod
    def start(memory: SimpleNamespace) -> None:
        """Nothing has been read."""
        memory.last[:], memory.step[:] = np.nan, np.inf

    @staticmethod
    def hear(memory: SimpleNamespace, position: np.ndarray) -> None:
        """Takes note of a reading in rad, (6,)."""
        candidates = memory.smaller, memory.count, memory.age
        kernels.history.least_change(position, memory.last, memory.step, *candidates, _ENOUGH, _WINDOW)

    @staticmethod
    def sigma(memory: SimpleNamespace) -> np.ndarray:
        """What a reading is wrong by in rad, (6,); zero of joints that have not moved."""
        return np.where(np.isfinite(memory.step), memory.step, 0.0) / math.sqrt(12.0)
