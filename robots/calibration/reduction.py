"""From redundant parameters to independent ones with names: for the report, never for the estimate.

Which parameters are independent follows from a factorisation by QR with pivoting of the regressor over the
robot's ranges, with columns scaled by the prior and a relative tolerance. A robot is then described by
these alone, exactly: those that are left out move into the others until every pose is the same.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import qr

from robots.calibration.error_model import ZEROS, ErrorModel
from robots.calibration.prior import parameter_sizes
from robots.description.model import RobotModel
from robots.pose import pose_error

TOLERANCE = 1e-8  # of the largest singular value; below it a direction is not there
_CONFIGURATIONS = 100  # random ones within the ranges
_STEPS = 25
_HIDDEN = 1e-7  # of the largest singular value: a table shows nothing of a direction
_INVOLVED = 1e-2  # of the largest share in a direction
_SAME = 1e-13  # m or rad of a last step


@dataclass(frozen=True)
class Reduction:
    """Independent parameters of a robot at some values of all of them.

    To first order dx[independent] = combination dx, all in SI units.
    """

    independent: np.ndarray  # (r,) indices
    combination: np.ndarray  # (r, m)
    values: np.ndarray  # (r,) the same robot described by the independent parameters alone

    @property
    def rank(self) -> int:
        """How many directions the measurement of a pose, or of a position, shows."""
        return len(self.independent)


class ReducibleModel:
    """A robot's error model over its ranges, as poses or positions show it."""

    def __init__(self, model: ErrorModel, position_only: bool = False) -> None:
        self._model, self._position_only = model, position_only
        self._sizes = parameter_sizes(model.names)
        robot = model.robot
        lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
        self._q = np.random.default_rng(0).uniform(lower, upper, (_CONFIGURATIONS, len(lower)))

    @cached_property
    def _drawn(self) -> np.ndarray:
        """Independent parameters of the robot as drawn, indices."""
        drawn = self.regressor(np.zeros(len(self._model)))
        # Zeros of joints first, as far as they are independent: a controller can take them.
        zeros = np.arange(len(self._model))[ZEROS][independent_columns(drawn[:, ZEROS])]
        return independent_columns(drawn, zeros)

    def regressor(self, x: np.ndarray) -> np.ndarray:
        """Rows of all configurations, columns in units of the prior, (rows, m)."""
        Theta = self._model.forward_and_regressor(self._q, x)[1]
        return Theta[:, 3 if self._position_only else 0 :].reshape(-1, len(x)) * self._sizes

    def independent(self, x: np.ndarray) -> np.ndarray:
        """Rising indices, (k,), of the parameters independent at x: the nominal robot's, and what x adds."""
        return np.sort(independent_columns(self.regressor(x), self._drawn))

    @cached_property
    def shown_by_errors(self) -> list[str]:
        """Names of what does not show on the robot as drawn, but on one with errors as large as expected.

        Positions of a tool that is drawn on the last axis say nothing of that joint; an error that moves the
        tool off it brings its zero and its place to light.
        """
        x = self._sizes * np.random.default_rng(0).choice([-1.0, 1.0], size=len(self._sizes))
        return [self._model.names[i] for i in np.setdiff1d(self.independent(x), self._drawn)]

    def reduce(self, x: np.ndarray, independent: np.ndarray | None = None) -> Reduction:
        """Describes the robot with parameters x, (m,), by independent ones alone."""
        chosen = self.independent(x) if independent is None else independent
        values = self.describe(lambda q: self._model.forward(q, x), chosen, x)
        reduced = np.zeros(len(self._model))
        reduced[chosen] = values
        at_reduced = self.regressor(reduced)[:, chosen]
        combination = np.linalg.lstsq(at_reduced, self.regressor(x), rcond=None)[0]
        return Reduction(chosen, combination * self._sizes[chosen, None] / self._sizes, values)

    def independent_with(self, first: np.ndarray) -> np.ndarray:
        """Independent parameters of the nominal robot, with certain ones before all others."""
        return np.sort(independent_columns(self.regressor(np.zeros(len(self._model))), first))

    def hidden(self, A: np.ndarray, columns: np.ndarray, x: np.ndarray) -> list[str]:
        """Names of what the ranges of the robot would show, and a table does not show at all.

        Args:
            A: derivative of the table's rows by some parameters in SI units, shape (rows, c).
            columns: indices of these parameters, shape (c,).
            x: all parameters, shape (m,).
        """
        possible = self.regressor(x)[:, columns]
        _, s, Vt = np.linalg.svd(np.linalg.qr(possible, mode="r"))
        seen = s > TOLERANCE * s[0]
        directions = Vt[: len(s)][seen].T / s[seen]  # the ranges show all of them alike
        rows = A * self._sizes[columns] @ directions
        padded = np.vstack([rows, np.zeros((max(0, rows.shape[1] - len(rows)), rows.shape[1]))])
        _, shown, Wt = np.linalg.svd(padded, full_matrices=False)
        lost = directions @ Wt[shown < _HIDDEN * shown[0]].T
        if not lost.shape[1]:
            return []
        chosen = np.flatnonzero(np.isin(columns, self.independent(x)))
        named = np.linalg.lstsq(possible[:, chosen], possible @ lost, rcond=None)[0]
        involved = (np.abs(named) > _INVOLVED * np.abs(named).max(axis=0)).any(axis=1)
        return [self._model.names[columns[i]] for i in chosen[involved]]

    def describe(
        self, forward: Callable[[np.ndarray], np.ndarray], chosen: np.ndarray, start: np.ndarray
    ) -> np.ndarray:
        """Values (r,) of some parameters, all others zero, with which the model has the poses of ``forward``.

        Args:
            forward: tool poses (n, 4, 4) at joint positions (n, 6).
            chosen: indices of the parameters.
            start: all parameters of a description that may be redundant, to begin from.
        """
        wanted = forward(self._q)
        full = self.regressor(start)
        first = np.linalg.lstsq(full[:, chosen], full @ (start / self._sizes), rcond=None)[0]
        reduced = np.zeros(len(self._model))
        reduced[chosen] = first * self._sizes[chosen]
        for _ in range(_STEPS):
            X, Theta = self._model.forward_and_regressor(self._q, reduced)
            A = Theta[:, 3 if self._position_only else 0 :, chosen] * self._sizes[chosen]
            e = self._gaps(wanted, X)
            step = np.linalg.lstsq(A.reshape(-1, len(chosen)), e.ravel(), rcond=None)[0]
            step *= min(1.0, 3.0 / max(float(np.abs(step).max()), 1e-300))
            reduced[chosen] += step * self._sizes[chosen]
            if np.abs(step * self._sizes[chosen]).max() < _SAME:
                break
        return reduced[chosen]

    def _gaps(self, wanted: np.ndarray, X: np.ndarray) -> np.ndarray:
        if self._position_only:
            return wanted[:, :3, 3] - X[:, :3, 3]
        return pose_error(wanted, X)


def shown_by_errors(robot: RobotModel, position_only: bool) -> list[str]:
    """As the attribute of `ReducibleModel`, of a nominal robot."""
    return ReducibleModel(ErrorModel(robot), position_only).shown_by_errors


def independent_columns(
    A: np.ndarray, first: np.ndarray | None = None, tolerance: float = TOLERANCE
) -> np.ndarray:
    """Indices of a largest well-conditioned set of independent columns, by QR with pivoting.

    Args:
        A: columns scaled to comparable size, shape (rows, m).
        first: columns that are taken before all others.
        tolerance: a direction counts if its singular value exceeds this share of the largest one.
    """
    R = np.asarray(np.linalg.qr(A, mode="r"))
    s = np.linalg.svd(R, compute_uv=False)
    rank = int(np.sum(s > tolerance * s[0])) if s[0] > 0.0 else 0
    first = np.empty(0, dtype=int) if first is None else first[:rank]
    basis = np.linalg.qr(R[:, first])[0]
    rest = np.setdiff1d(np.arange(A.shape[1]), first)
    others = R[:, rest] - basis @ (basis.T @ R[:, rest])
    _, pivots = qr(others, mode="r", pivoting=True)  # pyright: ignore[reportAssignmentType]
    return np.concatenate([first, rest[pivots[: rank - len(first)]]]).astype(int)
