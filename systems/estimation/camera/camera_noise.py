"""How noisy the camera is, whatever is believed of it."""

from types import SimpleNamespace

import numpy as np

from systems.estimation import kernels
from systems.estimation.memory import Layout
from systems.estimation.tip_model import Pair

_OFTEN = 12  # samples, between two looks
_WINDOW = 500  # samples, in the mean
_OTHER = 2.0  # times the variance: less is not another one, for the first dozen shows it to a quarter
_MOST = 4.0  # times the mean, by a single sample: what jumps is the robot, or what is known of it
# Between two samples, as far as the path of what a robot is off by, by mm and mrad, is straight to 1 um.
_NEAR = 3e-3, 6e-3  # m and rad


class CameraNoise:
    """The variance of a sample, from how far three in a row are off a straight line.

    What the tip is off by, at parameters that stay what they are, changes smoothly as the robot moves. The
    noise of three samples gives their second difference six times its variance. Variances are those that
    are believed until more is seen. A camera that is better than that is not trusted more: what no parameter
    describes does not go away with its noise.
    """

    def __init__(self, variances: np.ndarray) -> None:
        """Takes the variances of one sample that are believed, rotation first, (6,)."""
        self._variances = variances
        self.layout = Layout(
            variances=(6,),  # as samples are weighted now
            weights=(6,),  # one over them
            last=(2, 6),  # errors of the last samples, newest first
            times=(2,),
            held=(1,),  # how many of them there are
            scatter=(6,),  # mean of what was seen
            changes=(1,),  # in this mean
        )

    def start(self, memory: SimpleNamespace) -> None:
        """Writes what is believed before the first sample."""
        memory.variances[:], memory.weights[:] = self._variances, 1.0 / self._variances

    def hear(self, memory: SimpleNamespace, r: np.ndarray, H: np.ndarray, xi: np.ndarray, pair: Pair) -> bool:
        """Takes one innovation that is no outlier.

        Args:
            memory: of the layout.
            r: the pose error at xi, (6,).
            H: its columns, (6, n).
            xi: the estimate, (n,).
            pair: of the sample.

        Returns:
            Whether samples weigh something else from now on.
        """
        mean = memory.last, memory.times, memory.held, memory.scatter, memory.changes
        limits = _NEAR, _MOST, _WINDOW
        kernels.innovations.bend(r, H, xi, pair.twist, pair.time, self._variances, limits, *mean)
        if memory.changes[0] == 0.0 or memory.changes[0] % _OFTEN:
            return False
        seen = np.repeat(memory.scatter.reshape(2, 3).mean(axis=1), 3)
        variances = np.maximum(seen, self._variances)
        ratio = variances / memory.variances
        if (ratio < _OTHER).all() and (ratio > 1.0 / _OTHER).all():
            return False
        memory.variances[:], memory.weights[:] = variances, 1.0 / variances
        memory.changes[0] = 0.0  # the first ones of a far noisier camera are cut off
        return True
