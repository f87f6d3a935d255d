"""Small changes of numbers that make a measured deviation smaller: between bounds, and no more than is shown.

Changes are logarithms of factors. What of the deviation no change explains is not noise but the same thing
for tenths of a second, so that it counts for as little as parts of a motion agree about it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from robots.identification.arm_fit import part_of, scatter

_ROUNDS = 8  # in which the weight of the deviation settles
_FINEST = 1e-6  # m: no camera sees less
_ORIGIN = 3.0  # scipy's first step is as long as the vector that it begins with
_GAIN, _STEP = 1e-2, 1e-3  # relative, of the cost and of the changes, below which it ends


@dataclass(frozen=True)
class Sensitivity:
    """How the deviation at m instants changes with k numbers."""

    slope: np.ndarray  # (m, 3, k) m, by the logarithms of the numbers
    parts: np.ndarray  # (m,) int, which part of the motion an instant belongs to
    sigma: np.ndarray  # (k,) standard deviations of the logarithms, as believed
    limit: float  # of the logarithms, either way

    @property
    def effect(self) -> np.ndarray:
        """By how much the tip moves with a change of one standard deviation: root mean square in m, (k,)."""
        return self.sigma * np.sqrt(np.mean(np.sum(np.square(self.slope), axis=1), axis=0))

    def of(self, chosen: np.ndarray) -> "Sensitivity":
        """That of some numbers alone."""
        return replace(self, slope=self.slope[..., chosen], sigma=self.sigma[chosen])

    def weighed(self, gap: np.ndarray) -> tuple[float, np.ndarray]:
        """What a deviation (m, 3) is worth.

        Returns:
            The spread in m for which it counts for what parts of the motion agree about, and the covariance
            of the changes with it, (k, k).
        """
        spread, alike = float(np.sqrt(np.mean(gap**2))), 1.0
        J, k = self.slope * self.sigma, len(self.sigma)
        if not k:
            return spread, np.zeros((0, 0))
        whole, flat = np.eye(k), J.reshape(-1, k)
        for _ in range(_ROUNDS):
            # Without bounds: at one of them all parts pull the same way, which is no disagreement.
            weight = (alike * spread) ** 2
            x = np.linalg.solve(flat.T @ flat + weight * np.eye(k), -flat.T @ gap.ravel())
            left = gap + J @ x
            spread = max(float(np.sqrt(np.mean(left**2))), _FINEST)
            scale = alike * spread
            parts = [
                part_of(J[self.parts == n] / scale, left[self.parts == n] / scale)
                for n in np.unique(self.parts)
            ]
            information = np.sum([part.information for part in parts], axis=0)
            noise = np.linalg.inv(information + np.eye(len(information)))
            pulled = scatter(parts, noise)
            shown = max(float(np.trace(noise @ information)), np.finfo(float).tiny)
            alike *= np.sqrt(max(1.0, float(np.trace(np.linalg.solve(noise, pulled))) / shown))
            whole = noise + pulled
        return alike * spread, whole * np.outer(self.sigma, self.sigma)

    def shown(self, gap: np.ndarray, at_least: float, at_most: int) -> np.ndarray:
        """Which numbers the motion shows, so many at most: indices in their order.

        Args:
            gap: in m, (m, 3).
            at_least: share of what is unsure of a number that the motion removes.
            at_most: how many.
        """
        spread, _ = self.weighed(gap)
        J = (self.slope * self.sigma).reshape(-1, len(self.sigma)) / spread
        left = np.diagonal(np.linalg.inv(J.T @ J + np.eye(len(self.sigma))))
        removed = 1.0 - np.sqrt(left)
        best = np.argsort(-removed)[:at_most]
        return np.sort(best[removed[best] >= at_least])


def tune(
    deviation: Callable[[np.ndarray], np.ndarray], sensitivity: Sensitivity, spread: float, runs: int
) -> np.ndarray:
    """The changes (k,) with which a robot deviates least; the sensitivity stays what it is.

    Args:
        deviation: drives the robot with changes (k,) and measures, (m, 3) m; first without any.
        sensitivity: of the numbers that may change.
        spread: in m, of what is not explained.
        runs: how often the robot may be driven.
    """
    sigma, limit, k = sensitivity.sigma, sensitivity.limit, len(sensitivity.sigma)
    J = np.vstack([(sensitivity.slope * sigma).reshape(-1, k) / spread, np.eye(k)])

    def residuals(y: np.ndarray) -> np.ndarray:
        x = y - _ORIGIN
        return np.concatenate([deviation(sigma * x).ravel() / spread, x])

    bound = limit / sigma
    found = least_squares(
        residuals,
        np.full(k, _ORIGIN),
        lambda y: J.copy(),  # pyright: ignore[reportArgumentType]  # its stub knows names alone
        bounds=(_ORIGIN - bound, _ORIGIN + bound),
        max_nfev=runs,
        ftol=_GAIN,
        xtol=_STEP,
    )
    return np.clip(sigma * (found.x - _ORIGIN), -limit, limit)
