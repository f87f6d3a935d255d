"""What samples of the past said, kept so that it can be read again with better parameters."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
from scipy.linalg import get_lapack_funcs

from systems.estimation import kernels
from systems.estimation.arm_geometry import Constants
from systems.estimation.gears.gear_errors import NUM_SHAPES
from systems.estimation.kernels.arrays import SHAPES, OpenKeyframe
from systems.estimation.memory import Layout
from systems.estimation.tip_model import TipModel

# m or rad, by which the parameters may be off from where the sum was linearised: half of its square, over an
# arm of a metre, is a third of what the mean of a dozen samples of a good camera may be wrong by.
_LINEAR = 3e-3
(_cholesky,) = get_lapack_funcs(("potrf",), dtype=np.float64)


class Keyframes:
    """Merged samples in a ring, and their information at parameters that are kept up to date, a few a tick.

    Information is summed up in passes: each works through the ring with the parameters of now, and takes the
    place of the sum of the last pass when it is through. Where the ring is full, the oldest keyframes leave
    it for good: what they said stays in ``old``, which fades slowly, so that neither memory nor confidence
    grows without bound.
    """

    def __init__(self, model: TipModel, length: int = 512, batch: int = 5) -> None:
        """Lays out the memory.

        Args:
            model: of the tip.
            length: how many keyframes there can be.
            batch: how many are worked through in a tick.
        """
        self._model, self._length, self._batch = model, length, batch
        n = model.size
        self.layout = Layout(
            rows=(length, SHAPES + 6 * (NUM_SHAPES + 1) * model.has_gear_errors),
            first=(1,),
            end=(1,),
            position=(1,),  # of the pass; below zero for none
            leaving=(1,),  # keyframes before this one leave with this pass
            xi_pass=(n,),
            xi_sum=(n,),  # of the pass that made the sum
            A_old=(n, n),
            b_old=(n,),
            A=(n, n),  # old and ring
            b=(n,),
            A_pass=(n, n),
            b_pass=(n,),
            A_leaving=(n, n),
            b_leaving=(n,),
        )

    def reset(self, memory: SimpleNamespace, A: np.ndarray, xi: np.ndarray) -> None:
        """Forgets all keyframes; the information A about xi is what is left."""
        b = A @ xi
        memory.xi_sum[:] = xi
        memory.first[0] = memory.end[0] = 0.0
        memory.position[0] = -1.0
        memory.A_old[:], memory.b_old[:], memory.A[:], memory.b[:] = A, b, A, b
        memory.xi_pass[:] = np.inf

    def add(self, memory: SimpleNamespace, A: np.ndarray) -> None:
        """Adds information about zero, (n, n), to what was known before any keyframe."""
        memory.A_old += A
        memory.A += A

    def close(
        self, memory: SimpleNamespace, constants: Constants, xi: np.ndarray, opened: OpenKeyframe
    ) -> bool:
        """Adds a keyframe: one pose at the mean of the open samples, with their mean error and information.

        Args:
            memory: of the layout.
            constants: the geometry at xi.
            xi: the estimate.
            opened: the samples.

        Returns:
            Whether there was room for it.
        """
        first, end = int(memory.first[0]), int(memory.end[0])
        if end - first >= self._length:
            return False
        model = self._model
        arm = constants, model.unknowns(model.full(xi)), model.loads.masses
        kernels.keyframes.merge(*arm, xi, opened, memory.rows[end % self._length])
        memory.end[0] = end + 1
        memory.A += opened.A
        memory.b += opened.b
        return True

    @staticmethod
    def invert(memory: SimpleNamespace, A_open: np.ndarray, P: np.ndarray) -> bool:
        """Writes the covariance P that belongs to the sum and to A_open, (n, n); False if there is none.

        Of A_open the lower half is enough.
        """
        factor, failed = _cholesky((memory.A + A_open).T, lower=0)
        if not failed:
            kernels.information.invert(factor.T, P)
        return not failed

    def begin_again(self, memory: SimpleNamespace) -> None:
        """Has all keyframes read anew, though no parameter has moved: they weigh something else."""
        memory.position[0] = -1.0
        memory.xi_pass[:] = np.inf

    def is_settled(self, memory: SimpleNamespace, xi: np.ndarray) -> bool:
        """Whether the sum is linear where the parameters are.

        What a linearisation far off leaves looks like a change of the robot.
        """
        return self._change(xi, memory.xi_sum) <= _LINEAR

    def _change(self, xi: np.ndarray, before: np.ndarray) -> float:
        """The largest change of a geometric parameter in m or rad."""
        return kernels.tip.largest_step(xi, before, self._model.sigma, self._model.K.start)

    def work(
        self,
        memory: SimpleNamespace,
        constants: Callable[[], Constants],
        xi: np.ndarray,
        weights: np.ndarray,
        tolerance: float,
        prior: Callable[[], np.ndarray],
    ) -> bool:
        """Goes on with a pass, or begins one if a parameter has moved by more than the tolerance (m, rad).

        Args:
            memory: of the layout.
            constants: gives the geometry at xi; asked if there is something to read.
            xi: the estimate.
            weights: of the six entries of a pose error, one over their variances.
            tolerance: of the parameters.
            prior: gives what is known before any keyframe, (n, n); asked if old ones fade.

        Returns:
            Whether the sum has been replaced.
        """
        first, end = int(memory.first[0]), int(memory.end[0])
        if memory.position[0] < 0.0:
            is_full = end - first > self._length - 48
            if first == end or not (is_full or self._change(xi, memory.xi_pass) > tolerance):
                return False
            memory.position[0] = first
            memory.leaving[0] = end - self._length + 96 if is_full else first
            memory.xi_pass[:] = xi
            for part in (memory.A_pass, memory.b_pass, memory.A_leaving, memory.b_leaving):
                part[:] = 0.0
        position = int(memory.position[0])
        leaving = int(memory.leaving[0])
        if position < end:
            until = min(position + self._batch, end, max(leaving, position) if position < leaving else end)
            is_leaving = position < leaving
            A = memory.A_leaving if is_leaving else memory.A_pass
            b = memory.b_leaving if is_leaving else memory.b_pass
            model = self._model
            arm = constants(), model.unknowns(model.full(xi)), model.loads.masses
            kernels.keyframes.read(*arm, xi, memory.rows, position, until, weights, A, b)
            memory.position[0] = until
            return False
        # What follows has a tick of its own.
        if leaving > first:
            # Old knowledge fades as new knowledge joins it.
            fading = 1.0 - (leaving - first) / 3000.0
            memory.A_old[:] = fading * memory.A_old + (1.0 - fading) * prior()
            memory.A_old += memory.A_leaving
            memory.b_old[:] = fading * memory.b_old + memory.b_leaving
            memory.first[0] = leaving
        memory.A[:] = memory.A_old + memory.A_pass
        memory.b[:] = memory.b_old + memory.b_pass
        memory.xi_sum[:] = memory.xi_pass
        memory.position[0] = -1.0
        return True


def open_keyframe(memory: SimpleNamespace) -> OpenKeyframe:
    """The keyframe that a `TipEstimator` adds samples to, as views of its memory."""
    sums = memory.A_open, memory.b_open, memory.samples, memory.weight
    return OpenKeyframe(*sums, memory.first_theta, memory.sums, memory.sum_y, memory.sum_H)


def forget_open(memory: SimpleNamespace) -> None:
    """Empties it."""
    opened = memory.A_open, memory.b_open, memory.samples, memory.weight, memory.sums
    for part in (*opened, memory.sum_y, memory.sum_H):
        part[:] = 0.0
