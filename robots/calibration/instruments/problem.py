"""The lines of all instruments and the parameters that are to explain them, in one adjustment.

The parameters are those of the error model, then the places of targets on the tool, the frames of
instruments (a shift and a turn on top of where they stand at first), the anchors of distances, and, where the
joints are to yield, compliances and errors of masses. The lines
of one configuration belong together, because they share the noise of its joints; where configurations have
different numbers of lines, what is missing is filled with zeros that weigh nothing.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from robots.calibration.error_model import ZEROS, ErrorModel, exponential
from robots.calibration.instruments.observations import COORDINATES, MeasuringCell, Observations
from robots.calibration.loads import Loads
from robots.calibration.prior import OWN_FRAME, parameter_sizes
from robots.calibration.reduction import ReducibleModel
from robots.calibration.solver.problem import Linearised
from robots.calibration.yielding_joints import YIELDING_NAMES, Sag, YieldingJoints, yielding_sizes

PLACE, ANCHOR = 0.5, 1.0  # m, standard deviations before the measurement


@dataclass(frozen=True)
class Start:
    """Where targets, frames and anchors are before the adjustment."""

    places: np.ndarray  # (targets, 3) m, on the tool
    frames: np.ndarray  # (instruments, 4, 4) world of the robot in the frame of the instrument
    anchors: np.ndarray  # (instruments, 3) m, in the world


@dataclass(frozen=True)
class Setting:
    """Targets, frames and anchors at some parameters, and how frames turn."""

    places: np.ndarray
    frames: np.ndarray
    anchors: np.ndarray
    turning: np.ndarray  # (instruments, 3, 3) left Jacobians of the frames' turns


class InstrumentProblem:
    """Predicts lines from free parameters u in units of their prior."""

    def __init__(
        self,
        model: ErrorModel,
        observations: Observations,
        cell: MeasuringCell,
        start: Start,
        is_yielding: bool = False,
        fixed: Collection[str] = (),
    ) -> None:
        """Puts the parts together.

        Args:
            model: the kinematics.
            observations: the lines.
            cell: what is known before; the rest is free.
            start: where targets, frames and anchors are.
            is_yielding: whether compliances of the joints and errors of masses are parameters, too.
            fixed: names of parameters that stay zero.

        Raises:
            ValueError: if a fixed parameter is unknown.
        """
        self.model, self.observations, self._start = model, observations, start
        bars = [observations.is_bar(i) for i in range(len(observations.instruments))]
        blocks: list[tuple[list[str], np.ndarray, bool]] = [
            (list(model.names), parameter_sizes(model.names), True)
        ]
        for name in observations.targets:
            names = [f"target_{name}_{axis}" for axis in "xyz"]
            blocks.append((names, np.full(3, PLACE), name not in cell.places))
        for name, is_bar in zip(observations.instruments, bars, strict=True):
            names = [f"frame_{name}_{kind}" for kind in ("x", "y", "z", "rx", "ry", "rz")]
            blocks.append((names, np.full(6, OWN_FRAME), not is_bar and name not in cell.frames))
        for name, is_bar in zip(observations.instruments, bars, strict=True):
            names = [f"anchor_{name}_{axis}" for axis in "xyz"]
            blocks.append((names, np.full(3, ANCHOR), is_bar and name not in cell.anchors))
        self._placed = sum(len(names) for names, _, _ in blocks)
        self._yielding = None
        if is_yielding:
            self._yielding = YieldingJoints(model, Loads(model.robot, observations.loads))
            blocks.append((list(YIELDING_NAMES), yielding_sizes(model.robot), True))
        self.names = tuple(name for names, _, _ in blocks for name in names)
        self.sizes = np.concatenate([sizes for _, sizes, _ in blocks])
        free = np.concatenate([np.full(len(sizes), is_free) for _, sizes, is_free in blocks])
        self.columns = np.setdiff1d(np.flatnonzero(free), self._not_free(fixed))
        # Those of the robot itself, not of what stands around it.
        number = np.arange(len(self.sizes))
        self.is_of_robot = (number < len(model)) | (number >= self._placed)
        self._values = observations.numbers
        self.active = np.isfinite(self._values)  # (m, 3) what is compared
        # Lines of a configuration stand beside each other: line m is number slot[m] of row[m].
        order = np.argsort(observations.row, kind="stable")
        rows = observations.row[order]
        first = np.searchsorted(rows, rows)
        self._slot = np.empty(len(rows), dtype=int)
        self._slot[order] = np.arange(len(rows)) - first
        self.most = int(self._slot.max()) + 1
        self.width = COORDINATES * self.most

    def _not_free(self, fixed: Collection[str]) -> np.ndarray:
        """Indices of fixed parameters, and of those of the robot that would take their places."""
        unknown = [name for name in fixed if name not in self.names]
        if unknown:
            raise ValueError(
                f"identification: no parameter is called {unknown[0]}; there are {', '.join(self.names)}"
            )
        chosen = np.array([self.names.index(name) for name in fixed], dtype=int)
        drawn = chosen[chosen < len(self.model)]
        if not len(drawn):
            return chosen
        independent = ReducibleModel(self.model).independent_with(drawn)
        return np.union1d(chosen, np.setdiff1d(np.arange(len(self.model)), independent))

    def __len__(self) -> int:
        """How many configurations there are, n."""
        return len(self.observations.q)

    def parameters(self, u: np.ndarray) -> np.ndarray:
        """All parameters in SI units from the free ones in units of the prior."""
        x = np.zeros(len(self.sizes))
        x[self.columns] = u * self.sizes[self.columns]
        return x

    def setting(self, x: np.ndarray) -> Setting:
        """Targets, frames and anchors at all parameters."""
        rest = x[len(self.model) : self._placed]
        targets, instruments = len(self._start.places), len(self._start.frames)
        places, frames, anchors = np.split(rest, [3 * targets, 3 * targets + 6 * instruments])
        moved, turning = self._start.frames.copy(), np.tile(np.eye(3), (instruments, 1, 1))
        for i, (d, w) in enumerate(frames.reshape(instruments, 2, 3)):
            turn, turning[i] = exponential(w)
            moved[i, :3] = turn @ self._start.frames[i, :3]
            moved[i, :3, 3] += d
        places = self._start.places + places.reshape(-1, 3)
        return Setting(places, moved, self._start.anchors + anchors.reshape(-1, 3), turning)

    def residuals(self, u: np.ndarray) -> np.ndarray:
        """Measured less predicted numbers, (n, k), zeros where nothing was measured."""
        x = self.parameters(u)
        seen = self.observations
        sag = self._sag(x)
        X = self.model.forward(sag.q if sag else seen.q, x[: len(self.model)], seen.q)[seen.row]
        at = self.setting(x)
        p = _turned(X[:, :3, :3], at.places[seen.target]) + X[:, :3, 3]
        return self.spread(self._compared(p, at))

    def linearise(self, u: np.ndarray) -> Linearised:
        """Residuals with their derivatives, (n, k), (n, k, m) and (n, k, 6)."""
        x, seen = self.parameters(u), self.observations
        sag, model = self._sag(x), len(self.model)
        chain, Theta = self.model.chain_and_regressor(sag.q if sag else seen.q, x[:model], seen.q)
        X, at = chain.X_WE, self.setting(x)
        lever = _turned(X[seen.row, :3, :3], at.places[seen.target])
        p = lever + X[seen.row, :3, 3]
        dp = np.zeros((len(seen), 3, len(self.sizes)))  # of the target in the world
        if sag and self._yielding:
            Theta, by_y = self._yielding.columns(chain, Theta, x[self._placed :], sag)
            dp[:, :, self._placed :] = _of_points(by_y[seen.row], lever)
        dp[:, :, :model] = _of_points(Theta[seen.row], lever)
        for target in range(len(at.places)):
            lines = np.flatnonzero(seen.target == target)
            begin = model + 3 * target
            dp[lines, :, begin : begin + 3] = X[seen.row[lines], :3, :3]
        dy = self._by_instrument(p, dp, at)
        A = dy[:, :, self.columns] * self.sizes[self.columns]
        A[~self.active], dy[~self.active] = 0.0, 0.0
        return Linearised(self.spread(self._compared(p, at)), self.spread(A), self.spread(dy[:, :, ZEROS]))

    def _sag(self, x: np.ndarray) -> Sag | None:
        """What bends the joints; None for stiff ones."""
        if self._yielding is None:
            return None
        return self._yielding.sag(self.observations.q, x[: len(self.model)], x[self._placed :])

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Values of lines, (m, 3, ...), beside each other in their configurations, (n, k, ...)."""
        padded = np.zeros((len(self), self.most, *values.shape[1:]))
        padded[self.observations.row, self._slot] = values
        return padded.reshape(len(self), self.width, *values.shape[2:])

    def gathered(self, values: np.ndarray) -> np.ndarray:
        """The reverse of `spread`: (n, k, ...) to (m, 3, ...)."""
        shaped = values.reshape(len(self), self.most, COORDINATES, *values.shape[2:])
        return shaped[self.observations.row, self._slot]

    def _compared(self, p: np.ndarray, at: Setting) -> np.ndarray:
        """Measured less predicted, (m, 3)."""
        seen = self.observations
        frames = at.frames[seen.instrument]
        predicted = _turned(frames[:, :3, :3], p) + frames[:, :3, 3]
        is_distance = np.isfinite(seen.distance)
        away = p - at.anchors[seen.instrument]
        predicted[is_distance, 0] = np.linalg.norm(away[is_distance], axis=1)
        return np.where(self.active, np.nan_to_num(self._values) - predicted, 0.0)

    def _by_instrument(self, p: np.ndarray, dp: np.ndarray, at: Setting) -> np.ndarray:
        """Derivative of what instruments show, (m, 3, all parameters), from that of targets in the world."""
        seen = self.observations
        dy = np.empty_like(dp)
        frames_begin = len(self.model) + 3 * len(at.places)
        anchors_begin = frames_begin + 6 * len(at.frames)
        for i, X in enumerate(at.frames):
            lines = np.flatnonzero(seen.instrument == i)
            if seen.is_bar(i):
                away = p[lines] - at.anchors[i]
                unit = away / np.linalg.norm(away, axis=1)[:, None]
                dy[lines] = 0.0
                dy[lines, 0] = np.einsum("mi,mij->mj", unit, dp[lines])
                dy[lines, 0, anchors_begin + 3 * i : anchors_begin + 3 * i + 3] = -unit
                continue
            dy[lines] = X[:3, :3] @ dp[lines]
            begin = frames_begin + 6 * i
            shown = p[lines] @ X[:3, :3].T + X[:3, 3]
            before = shown - (at.frames[i, :3, 3] - self._turned_origin(i, at))
            dy[lines, :, begin : begin + 3] = np.eye(3)
            dy[lines, :, begin + 3 : begin + 6] = np.cross(
                np.broadcast_to(at.turning[i], (len(lines), 3, 3)), before[:, :, None], axis=1
            )
        return dy

    def _turned_origin(self, i: int, at: Setting) -> np.ndarray:
        """Where the world's origin is in a frame that has been turned and not yet shifted."""
        turn = at.frames[i, :3, :3] @ self._start.frames[i, :3, :3].T
        return turn @ self._start.frames[i, :3, 3]


def _of_points(Theta: np.ndarray, lever: np.ndarray) -> np.ndarray:
    """Derivatives of points from those of poses (m, 6, c), at levers from their origins (m, 3): (m, 3, c)."""
    return Theta[:, 3:] + np.cross(Theta[:, :3], lever[:, :, None], axis=1)


def _turned(R: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.einsum("mij,mj->mi", R, v)
