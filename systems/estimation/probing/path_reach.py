"""Whether a robot reaches a path that another one, of which it is known better and better, does reach."""

from collections.abc import Callable

import numpy as np

from systems.estimation import kernels
from systems.estimation.arm_geometry import Constants
from systems.estimation.probing.path_needs import SCALE, PathNeeds
from systems.reference.cartesian_path import CartesianPath, OutOfReachError

_LOOKED_AT = 8  # instants of a lap
_EVERY = 4  # ticks, one of them
_MISSED = 1e-3  # m, from which on it counts, beyond three standard deviations


class PathReach:
    """The instants of a lap at which the nominal arm moves the tip least in some direction: it is stretched.

    A robot that differs from it by some millimetres may not get there, and its joints would be thrown about.
    """

    def __init__(self, needs: PathNeeds, path: CartesianPath) -> None:
        """Chooses the instants from those of ``needs``."""
        weakest = [np.linalg.svd(SCALE[:, None] * needs.jacobian(q), compute_uv=False)[-1] for q in needs.q]
        chosen = np.argsort(weakest, kind="stable")[:_LOOKED_AT]
        self._needs, self._start = needs, path.path_start
        self._times, self._q = needs.times[chosen], needs.q[chosen]
        self._poses = path.sample(self._times)[0]
        self._missing(*needs.nominal, 0)  # what is compiled is there before a tick asks for it

    def look(
        self, constants: Constants, x: np.ndarray, covariance: Callable[[], np.ndarray], tick: int
    ) -> None:
        """Looks at one of the instants, at every fourth tick at the next one.

        Args:
            constants: of the geometry near x.
            x: parameters of the robot as it is known.
            covariance: of the unknowns in units of their spreads, (size, size), if it is asked for.
            tick: its number.

        Raises:
            OutOfReachError: if the robot does not get there, with how much is missing and when that is.
        """
        number, rest = divmod(tick, _EVERY)
        if rest:
            return
        k = number % len(self._times)
        left = self._missing(constants, x, k)
        if left < _MISSED:
            return
        time = float(self._times[k])
        if left < _MISSED + 3.0 * self._needs.sigma_between(covariance(), time, time):
            return
        missing = [self._missing(constants, x, each) for each in range(len(self._times))]
        worst = int(np.argmax(missing))
        raise OutOfReachError(
            f"the robot as it is known now does not reach its path: {1e3 * missing[worst]:.0f} mm are missing"
            f" {self._times[worst] - self._start:.1f} s after its begin. Move the path nearer to the robot"
        )

    def _missing(self, constants: Constants, x: np.ndarray, k: int) -> float:
        return kernels.plan.missing(constants, x, self._poses[k], self._q[k].copy())
