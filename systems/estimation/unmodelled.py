"""What the tip is off by that no parameter describes, as a camera shows it: gears, friction, quick motion."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from robots.kinematics.forward import robust_inverse
from systems.estimation import kernels
from systems.estimation.memory import Layout

_BLOCK = 24  # samples of a mean: a tenth of a second at 4 ms, in which a robot hardly changes what it lacks
_KEPT = 1.0 - 1.0 / 100.0  # of the weight of the blocks before, from one to the next

# Of the variance that gears are said to have, what is left at least, however little of it is seen: it comes
# where teeth cross their gap, seldom, and then all of it.
_LEAST_OF_GEARS = 0.4


class Doubts(NamedTuple):
    """What an innovation may contain, as far as that is known; covariances of the tip, rotation first."""

    noise: np.ndarray  # (6,), variances of the camera as they are measured
    by_model: np.ndarray  # (6, 6), by the estimate
    by_gears: np.ndarray  # (6, 6), by what gears may be off by in a whole block
    to_joints: np.ndarray  # (k, 6), from errors of the tip to those of joints; k is 6, or 0 if none are asked


def doubts(noise: np.ndarray, by_model: np.ndarray, J: np.ndarray, by_gears: np.ndarray) -> Doubts:
    """These of a tip with the Jacobian J, (6, 6), whose gears have variances in rad^2, (6,) or (0,)."""
    if not len(by_gears):
        return Doubts(noise, by_model, np.zeros((6, 6)), np.empty((0, 6)))
    return Doubts(noise, by_model, (J * by_gears) @ J.T, robust_inverse(J))


class Unmodelled:
    """The variance of the tip beyond noise and estimate, from means over blocks of innovations.

    If the model had everything, innovations would be as independent of each other as the camera's noise is,
    and the mean of n of them would have a variance of (R + H P H^T) / n. What a model lacks is nearly the
    same in a whole block and adds its square to that of the mean. Blocks count by how well they show it:
    early ones, when little was known, hardly at all.

    It is looked for along the axes of the tip, turns together and shifts together, and in each joint: gears
    of a wrist that are off by more than they are said to be turn the tool where the others hardly do.
    """

    def __init__(self, joints: int = 0) -> None:
        """Takes how many joints are looked at."""
        self._joints = joints
        self.layout = Layout(
            sums=(6,),
            samples=(1,),
            to_joints=(joints, 6),  # when the block began
            # What the estimate could be wrong by then along axes and in joints; 0 if that is not known
            by_model=(6 + joints,),
            by_gears=(6 + joints,),  # likewise
            excess=(2 + joints,),  # weighted sums over the blocks, of turns, of shifts, of each joint
            weights=(2 + joints,),
            by_joints=(joints,),  # weighted sums of what their gears were said to be off by
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
        noise, by_model, by_gears, to_joints = doubts()
        if memory.by_model[0] > 0.0:
            rows = _rows(memory.to_joints)
            expected = (rows**2 @ noise + memory.by_model) / _BLOCK + memory.by_gears
            excess = (rows @ memory.sums / _BLOCK) ** 2 - expected
            weights = 0.5 / expected**2  # one over the variance of a squared normal number
            memory.excess[:] = _KEPT * memory.excess + _together(weights * excess)
            memory.weights[:] = _KEPT * memory.weights + _together(weights)
            memory.by_joints[:] = _KEPT * memory.by_joints + (weights * memory.by_gears)[6:]
        memory.sums[:], memory.samples[0], memory.to_joints[:] = 0.0, 0.0, to_joints
        rows = _rows(to_joints)
        memory.by_model[:] = (rows @ by_model * rows).sum(axis=1)
        memory.by_gears[:] = (rows @ by_gears * rows).sum(axis=1)

    def rest(self, memory: SimpleNamespace) -> None:
        """Leaves out the present block and the next one: something happened to the robot."""
        memory.sums[:], memory.samples[0], memory.by_model[:] = 0.0, 0.0, 0.0

    def variances(self, memory: SimpleNamespace) -> np.ndarray:
        """What is to be added to the variances of the tip, rad^2 and m^2, (6,)."""
        return np.repeat(_mean(memory)[:2], 3)

    def joint_variances(self, memory: SimpleNamespace, by_gears: np.ndarray) -> np.ndarray:
        """What gears may be off by, rad^2, (6,): less or more than they are said to, where that is seen.

        Args:
            memory: of the layout.
            by_gears: what they are said to be off by, (6,); (0,) if no joints are looked at.
        """
        if not self._joints:
            return np.zeros(6)
        sums, out = (memory.excess[2:], memory.weights[2:], memory.by_joints), np.empty(self._joints)
        kernels.gears.seen(by_gears, *sums, _LEAST_OF_GEARS, out)
        return out


def _rows(to_joints: np.ndarray) -> np.ndarray:
    """The directions that are looked along: axes of the tip, then joints."""
    return np.concatenate((np.eye(6), to_joints))


def _together(values: np.ndarray) -> np.ndarray:
    """Sums of turns and of shifts, and the value of each joint."""
    return np.concatenate((values[:6].reshape(2, 3).sum(axis=1), values[6:]))


def _mean(memory: SimpleNamespace) -> np.ndarray:
    return np.maximum(memory.excess, 0.0) / np.maximum(memory.weights, 1e-300)
