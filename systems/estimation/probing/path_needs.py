"""How well the tip is known along a path, and how well it will be after a motion before it."""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from robots.dynamics.newton_inverse import inverse_kinematics
from systems.estimation.arm_geometry import Constants
from systems.estimation.tip_model import TipModel
from systems.reference.cartesian_path import CartesianPath

_MOST_INSTANTS = 48  # of the lap, evenly spaced in time
_INVERSE_STEP = 0.05  # s, between two poses of the inverse kinematics
# An angle counts as a way of the tip at an arm of 0.25 m.
SCALE = np.array([0.25, 0.25, 0.25, 1.0, 1.0, 1.0])


class Standing(NamedTuple):
    """How well the tip is known where it is known worst on a path."""

    sigma: float  # m, standard deviation of the tip, turns counted at an arm of 0.25 m
    time: float  # s, of the path
    unknown: int  # the one that has the largest part in it
    unknown_sigma: float  # its own, in its unit
    share: float  # of the tip's variance that would go if this one were known


class PathNeeds:
    """The path's columns: how the tip moves with each unknown, at instants all along its first lap.

    Other laps need nothing else, and what the first one shows is known when they begin.
    """

    def __init__(
        self, model: TipModel, weights: np.ndarray, path: CartesianPath, home: np.ndarray, late: float
    ) -> None:
        """Works out the joints along the first lap as the nominal robot would have them.

        Args:
            model: of the tip.
            weights: of the six entries of a pose error, one over their variances.
            path: that will be run, once or again and again.
            home: where the joints are near at its start, rad, (6,).
            late: s, by which samples may be late for use on the path.

        Raises:
            ValueError: if the nominal robot does not reach the path.
        """
        self._model, self._weights = model, weights
        self._lap_starts = np.asarray(path.lap_starts, dtype=float)
        end = path.lap_starts[1] if len(path.lap_starts) > 1 else path.dwell_start
        length = max(end - path.path_start, _INVERSE_STEP)
        steps = max(1, math.ceil(length / _INVERSE_STEP))
        times = path.path_start + np.linspace(0.0, length, steps + 1)
        inverse = inverse_kinematics(model.robot, float(model.mean[model.M][0]))
        q = inverse.along(path.sample(times)[0], home)
        velocity = np.gradient(q, times, axis=0)
        acceleration = np.gradient(velocity, times, axis=0)
        chosen = np.unique(np.linspace(0, steps, min(steps + 1, _MOST_INSTANTS)).round().astype(int))
        self.times, self.q = times[chosen], q[chosen]
        self._constants = model.constants(model.mean)
        self.H = self.columns(self.q, velocity[chosen], acceleration[chosen])
        self._seconds = length / max(1, len(chosen) - 1)
        self._blind = math.ceil(late / self._seconds)
        self._informations = np.array([self.information(H[None]) for H in self.H])

    def columns(self, q: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """How the tip moves with the unknowns in units of their spreads, (n, 6, size), for joints (n, 6)."""
        model = self._model
        arm = model.forward(self._constants, model.mean, q)[1]
        loads = model.loads.at(arm.frames, q, velocity, acceleration)
        twist = np.einsum("nij,nj->ni", arm.columns[:, :, :6], velocity)
        shapes = None
        if model.has_gear_errors:
            teeth = -np.sign(loads[:, 0, :6])
            still = np.hstack((np.zeros_like(teeth), teeth, teeth))
            shapes = np.array([model.gear_shapes(*row) for row in zip(q, still, strict=True)])
        return model.predict(self._constants, model.mean, q, loads, twist, shapes).H

    @property
    def prior(self) -> np.ndarray:
        """Information before anything is measured, (size, size)."""
        return self._model.prior

    @property
    def nominal(self) -> tuple[Constants, np.ndarray]:
        """The geometry of the nominal robot, and its parameters."""
        return self._constants, self._model.mean

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Of the tip of the nominal robot at joints q (rad, (6,)), rotation first, (6, 6)."""
        return self._model.jacobian(self._constants, self._model.mean, q)

    def information(self, H: np.ndarray) -> np.ndarray:
        """What one sample at each of n columns says of the unknowns, (size, size)."""
        rows = H.reshape(-1, H.shape[2])
        return (rows.T * np.tile(self._weights, len(H))) @ rows

    def expected(self, A: np.ndarray, rate: float) -> float:
        """How well the tip will be known in m where it is known worst, though the camera goes on looking.

        Args:
            A: information before the path begins.
            rate: samples of the camera in a second.
        """
        return self._worst(A, rate)[0]

    def forecast(self, A: np.ndarray, rate: float) -> Standing:
        """What lies behind `expected`, of which the arguments are."""
        sigma, worst, A = self._worst(A, rate)
        return self._standing(np.linalg.inv(A), worst, sigma)

    def standing(self, P: np.ndarray) -> Standing:
        """How well the tip is known on the path with the covariance P of the unknowns, (size, size)."""
        rows = SCALE[:, None] * self.H
        variance = np.einsum("nij,nij->n", rows @ P, rows)
        worst = int(variance.argmax())
        return self._standing(P, worst, math.sqrt(variance[worst]))

    def sigma_between(self, P: np.ndarray, begin: float, end: float) -> float:
        """How well the tip is known in m where it is known worst between two times on the path, on any lap.

        Args:
            P: covariance of the unknowns in units of their spreads, (size, size).
            begin, end: s; before the path begins the tip counts as at its begin, after it as at its end.
        """
        rows = self.rows_between(begin, end)
        return math.sqrt(float(np.einsum("nij,nij->n", rows @ P, rows).max()))

    def rows_between(self, begin: float, end: float) -> np.ndarray:
        """How the tip moves with the unknowns at instants between two times, as of `sigma_between`.

        Returns:
            In units of the spreads, (n, 6, size), all in m: turns counted at an arm of 0.25 m.
        """
        first, last = (self._nearest(t) for t in (begin, end))
        # Where a lap ends between the two, what is left of it and what has begun of the next one.
        chosen = np.arange(len(self.H))
        inside = (
            (chosen >= first) & (chosen <= last) if first <= last else (chosen >= first) | (chosen <= last)
        )
        return SCALE[:, None] * self.H[inside]

    def _nearest(self, t: float) -> int:
        """Which instant is nearest to a time on the path in s, on whatever lap."""
        lap = max(0, int(np.searchsorted(self._lap_starts, t, side="right")) - 1)
        return int(np.abs(self.times - (t - self._lap_starts[lap] + self._lap_starts[0])).argmin())

    def _worst(self, A: np.ndarray, rate: float) -> tuple[float, int, np.ndarray]:
        """The worst standard deviation of the tip in m, its place on the path, and the information there."""
        A, largest, worst, then = A.copy(), -1.0, 0, A
        for k, H in enumerate(self.H):
            if k >= self._blind:
                A += rate * self._seconds * self._informations[k - self._blind]
            Z = solve_triangular(np.linalg.cholesky(A), (SCALE[:, None] * H).T, lower=True)
            variance = float((Z * Z).sum())
            if variance > largest:
                largest, worst, then = variance, k, A.copy()
        return math.sqrt(largest), worst, then

    def _standing(self, P: np.ndarray, worst: int, sigma: float) -> Standing:
        effects = ((SCALE[:, None] * self.H[worst] @ P) ** 2).sum(axis=0) / np.diag(P)
        unknown = int(effects.argmax())
        share = float(effects[unknown]) / sigma**2
        own = float(self._model.sigma[unknown] * math.sqrt(P[unknown, unknown]))
        return Standing(sigma, float(self.times[worst]), unknown, own, share)
