"""What the tip is off by that no parameter describes, as a camera shows it: gears, friction, quick motion."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from systems.estimation.memory import Layout

_BLOCK = 24  # samples of a mean: a tenth of a second at 4 ms, in which a robot hardly changes what it lacks
_KEPT = 1.0 - 1.0 / 100.0  # of the weight of the blocks before, from one to the next


class Doubts(NamedTuple):
    """What an innovation may contain, as far as that is known."""

    factor: float  # of the camera's variance, in units of the one that is believed
    by_model: np.ndarray  # (6,), variances of the tip by the estimate, rotation first
    by_gears: np.ndarray  # (6,), by what gears may be off by in a whole block


class Unmodelled:
    """The variance of the tip beyond noise and estimate, from means over blocks of innovations.

    If the model had everything, innovations would be as independent of each other as the camera's noise is,
    and the mean of n of them would have a variance of (R + H P H^T) / n. What a model lacks is nearly the
    same in a whole block and adds its square to that of the mean. Blocks count by how well they show it:
    early ones, when little was known, hardly at all.
    """

    def __init__(self, variances: np.ndarray) -> None:
        """Takes the variances of one sample, (6,), rotation first."""
        self._variances = variances
        self.layout = Layout(
            sums=(6,),
            samples=(1,),
            by_model=(6,),  # what the estimate could be wrong by when the block began; 0 if that is not known
            by_gears=(6,),  # likewise
            excess=(2,),  # weighted sums over the blocks, of turns and of shifts
            weights=(2,),
        )

    def add(self, memory: SimpleNamespace, r: np.ndarray, doubts: Callable[[], Doubts]) -> None:
        """Takes one innovation.

        Args:
            memory: of the layout.
            r: the pose error, (6,).
            doubts: gives what it may contain; called once in a block.
        """
        memory.sums += r
        memory.samples[0] += 1.0
        if memory.samples[0] < _BLOCK:
            return
        factor, by_model, by_gears = doubts()
        if memory.by_model[0] > 0.0:
            expected = (factor * self._variances + max(1.0, factor) * memory.by_model) / _BLOCK
            expected += memory.by_gears
            excess = (memory.sums / _BLOCK) ** 2 - expected
            weights = 0.5 / expected**2  # one over the variance of a squared normal number
            memory.excess[:] = _KEPT * memory.excess + (weights * excess).reshape(2, 3).sum(axis=1)
            memory.weights[:] = _KEPT * memory.weights + weights.reshape(2, 3).sum(axis=1)
        memory.sums[:], memory.samples[0] = 0.0, 0.0
        memory.by_model[:], memory.by_gears[:] = by_model, by_gears

    def rest(self, memory: SimpleNamespace) -> None:
        """Leaves out the present block and the next one: something happened to the robot."""
        memory.sums[:], memory.samples[0], memory.by_model[:] = 0.0, 0.0, 0.0

    def variances(self, memory: SimpleNamespace) -> np.ndarray:
        """What is to be added to the variances of the tip, rad^2 and m^2, (6,)."""
        return np.repeat(np.maximum(memory.excess, 0.0) / np.maximum(memory.weights, 1e-300), 3)
