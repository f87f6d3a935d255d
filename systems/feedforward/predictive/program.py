"""The quadratic program of the predictive correction: six motors under their drives over some ticks."""

from dataclasses import replace

import numpy as np
import osqp
from scipy import sparse

from robots.description.model import NUM_JOINTS
from systems.feedforward.predictive.forecast import Cascade, Forecast
from systems.feedforward.predictive.free_optimum import FreeOptimum

_ERROR_UNIT = 1e-4  # rad, so that the solver sees numbers of about one
_PER_TICK = 3  # unknowns: error, what the integral gives, correction
_ACCURACY = 5e-4  # in these units
_STEP_SIZE = 0.01  # of the solver; found by trial, and fixed, for its own choice depends on the clock
_MOST_STEPS = 400
_STEP = 0.02  # to which the matrices are rounded, for they hardly change and are costly to factorise


class CorrectionProgram:
    """Finds the torques with which motors stay closest to their commands.

    R (2010), eqs. (5.11) and (5.12), linear and for the motors: the sum over the ticks of error^2 and of
    lambda_u^2 (change of the correction)^2 is least, where

        m e'' + (D + b) e' + P e + w + u = d,    w' = I e,

    in implicit steps of a tick, and the corrections u are within bounds. e is a motor's error, w what the
    drive's integral gives, b the slope of friction at the planned speed and d the disturbance. All unknowns
    of a tick are tied to the two ticks before alone, so the matrices are banded, and a solver for sparse
    problems takes time in proportion to the ticks. It begins from nothing each time: what comes out depends
    on the forecast alone. It is asked only where `FreeOptimum`, which is quicker, is out of bounds.
    """

    def __init__(self, cascade: Cascade, smoothness: float, period: float, ticks: int) -> None:
        """Lays out the matrices.

        Args:
            cascade: of every drive.
            smoothness: lambda_u in s^2.
            period: tick in s.
            ticks: how many are looked ahead.
        """
        self.ticks, self._period, self._cascade = ticks, period, cascade
        self._unit = _ERROR_UNIT * cascade.proportional  # rad/s^2, of torques
        self._free = FreeOptimum(cascade, smoothness, period, ticks)
        self._layout()
        size = _PER_TICK * ticks * NUM_JOINTS
        differences = sparse.eye(ticks - 1, ticks, k=1) - sparse.eye(ticks - 1, ticks)
        picks = [sparse.kron(sparse.eye(ticks), row[None]) for row in np.eye(_PER_TICK)]
        change = smoothness * self._unit / _ERROR_UNIT * differences @ picks[2]
        cost = sparse.block_diag([picks[0].T @ picks[0] + change.T @ change] * NUM_JOINTS)
        cost = sparse.triu(cost, format="csc")
        inertia, slope = np.ones(NUM_JOINTS), np.zeros((ticks, NUM_JOINTS))
        matrix = sparse.csc_matrix(
            (self._values(inertia, slope), self._indices, self._starts), shape=self._shape
        )
        self._solver = osqp.OSQP()
        self._solver.setup(
            cost,
            np.zeros(size),
            matrix,
            np.zeros(self._shape[0]),
            np.zeros(self._shape[0]),
            verbose=False,
            eps_abs=_ACCURACY,
            eps_rel=_ACCURACY,
            rho=_STEP_SIZE,
            adaptive_rho=False,
            warm_starting=False,
            check_termination=5,
            max_iter=_MOST_STEPS,
        )
        self._laid_out, self._cost = matrix.data, cost.data.copy()  # what the solver has

    def solve(self, forecast: Forecast) -> np.ndarray | None:
        """The corrections in rad/s^2 at all ticks, (n, 6); None if the solver finds none."""
        free = self._free.solve(forecast)
        if ((free >= forecast.lower) & (free <= forecast.upper)).all():
            return free
        return self.bounded(forecast)

    def bounded(self, forecast: Forecast) -> np.ndarray | None:
        """The same, by the solver whether a bound is in the way or not."""
        inertia = _in_steps(forecast.inertia, 1.0)
        slope = _in_steps(forecast.friction_slope, self._cascade.derivative)
        lower, upper = self._bounds(replace(forecast, inertia=inertia, friction_slope=slope))
        values = self._values(inertia, slope)
        if not np.array_equal(values, self._laid_out):
            self._laid_out = values
            # The cost does not change, but what is left in place is scaled to and fro, and rounded each time.
            self._solver.update(Px=self._cost, Ax=values)
        self._solver.update(l=lower, u=upper)
        found = self._solver.solve(raise_error=False)
        if found.info.status != "solved":
            return None
        u = self._unit * found.x.reshape(NUM_JOINTS, self.ticks, _PER_TICK)[:, :, 2].T
        return np.clip(u, forecast.lower, forecast.upper)

    def _layout(self) -> None:
        """Places of the entries of the constraints, and of what inertia and slope each is made."""
        c, T, n = self._cascade, self._period, self.ticks
        in_units = _ERROR_UNIT / self._unit
        entries = []  # row, column, constant, per inertia, per slope, tick of the slope, joint
        for joint in range(NUM_JOINTS):
            for k in range(n):
                tick = joint * n + k
                balance, integral, limit = (part * NUM_JOINTS * n + tick for part in range(3))
                e, w, u = (_PER_TICK * tick + part for part in range(_PER_TICK))
                P, m, b = in_units * c.proportional, in_units / T**2, in_units / T
                D = in_units * c.derivative / T
                entries += [
                    (balance, e, P + D, m, b, k, joint),
                    (balance, w, 1.0, 0.0, 0.0, k, joint),
                    (balance, u, 1.0, 0.0, 0.0, k, joint),
                    (integral, w, 1.0, 0.0, 0.0, k, joint),
                    (integral, e, -in_units * c.integral * T, 0.0, 0.0, k, joint),
                    (limit, u, 1.0, 0.0, 0.0, k, joint),
                ]
                if k > 0:
                    entries.append((balance, e - _PER_TICK, -D, -2.0 * m, -b, k, joint))
                    entries.append((integral, w - _PER_TICK, -1.0, 0.0, 0.0, k, joint))
                if k > 1:
                    entries.append((balance, e - 2 * _PER_TICK, 0.0, m, 0.0, k, joint))
        table = np.array(entries)
        rows, columns = table[:, 0].astype(int), table[:, 1].astype(int)
        order = np.lexsort((rows, columns))
        self._constant, self._per_inertia, self._per_slope = table[order, 2:5].T
        self._ticks_of, self._joints_of = table[order, 5:].astype(int).T
        self._shape = 3 * NUM_JOINTS * n, _PER_TICK * NUM_JOINTS * n
        self._indices = rows[order]
        self._starts = np.searchsorted(columns[order], np.arange(_PER_TICK * n * NUM_JOINTS + 1))

    def _values(self, inertia: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """Of the constraints' matrix, column after column."""
        of_slope = self._per_slope * slope[self._ticks_of, self._joints_of]
        return self._constant + self._per_inertia * inertia[self._joints_of] + of_slope

    def _bounds(self, forecast: Forecast) -> tuple[np.ndarray, np.ndarray]:
        T, m, e = self._period, forecast.inertia, forecast.error
        right = forecast.disturbance.copy()
        slope = self._cascade.derivative + forecast.friction_slope[0]
        right[0] += (m / T**2 + slope / T) * e + m / T * forecast.error_rate
        right[1] -= m / T**2 * e
        held = np.zeros_like(right)
        held[0] = forecast.integral
        lower, upper = (
            np.concatenate([each.T.ravel() for each in (right, held, bound)]) / self._unit
            for bound in (forecast.lower, forecast.upper)
        )
        return lower, upper


def _in_steps(values: np.ndarray, unit: float) -> np.ndarray:
    return _STEP * unit * np.round(values / (_STEP * unit))
