"""Millions of candidate configurations, screened exactly in a few hundredths of a second.

Every entry of the information matrix Theta^T Theta of a measurement is a trigonometric polynomial of degree
two at most in each joint angle. So is the gain tr(W Theta^T Theta) of a candidate, whatever the weights W:
it follows on a whole grid from its values at five angles per joint, by one small contraction per joint.
"""

from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.measurement_design.parameters import error_parameters

_DEGREE = 2
_NODES = 2.0 * np.pi * np.arange(2 * _DEGREE + 1) / (2 * _DEGREE + 1)
_HALF_TURN = 180.0  # deg
_FULL_TURN = 360.0 * (1.0 - 1e-9)


@dataclass(frozen=True)
class AxisRange:
    """The samples of one joint, equally spaced from lower to upper, both included."""

    lower_deg: float
    upper_deg: float
    samples: int = 13

    def angles(self) -> np.ndarray:
        """The samples in rad; the last of a full turn is the first once more and is left out."""
        angles = np.deg2rad(np.linspace(self.lower_deg, self.upper_deg, self.samples))
        return angles[:-1] if self.upper_deg - self.lower_deg >= _FULL_TURN else angles


def own_ranges(robot: RobotModel) -> tuple[AxisRange, ...]:
    """The ranges in which a robot is measured: those that its file names, else all of its own, up to a turn.

    Those of the IRB 1200 are those of Probst (2024), section 4.2: 13^6 = 4,826,809 candidates.
    """
    measuring = robot.measuring
    if measuring.lower_deg:
        return tuple(map(AxisRange, measuring.lower_deg, measuring.upper_deg))
    limits = np.rad2deg([robot.lower, robot.upper])
    half = np.minimum(0.5 * (limits[1] - limits[0]), _HALF_TURN)
    # Of a range of more than a turn, the turn around zero if it has one.
    middle = np.clip(0.0, limits[0] + half, limits[1] - half)
    return tuple(AxisRange(float(m - h), float(m + h)) for m, h in zip(middle, half, strict=True))


class CandidateGrid:
    """All configurations of a grid, by number, with the information that a measurement there would give."""

    def __init__(
        self,
        robot: RobotModel,
        ranges: tuple[AxisRange, ...] | None = None,
        position_only: bool = False,
        is_complete: bool = False,
    ) -> None:
        """Evaluates the regressor at the 5^6 nodes.

        Args:
            robot: the nominal robot.
            ranges: of the six joints; None for the robot's own.
            position_only: whether only the position of the tool is measured.
            is_complete: whether its parameters are those of the complete error model, or else those of Probst
                (2024).

        Raises:
            ValueError: if a range is empty or its samples are too few, or there are not six.
        """
        ranges = own_ranges(robot) if ranges is None else ranges
        if len(ranges) != NUM_JOINTS:
            raise ValueError(f"candidate grid: needs the ranges of {NUM_JOINTS} joints, got {len(ranges)}")
        for number, axis in enumerate(ranges, 1):
            if axis.samples < 2 or not axis.lower_deg < axis.upper_deg:
                raise ValueError(
                    f"candidate grid: joint {number} needs two samples or more in an increasing range, got "
                    f"{axis.samples} from {axis.lower_deg} to {axis.upper_deg} deg"
                )
        self.parameters = error_parameters(robot, position_only, is_complete)
        self._rows = slice(3, 6) if position_only else slice(0, 6)
        self.angles = [axis.angles() for axis in ranges]
        self.shape = tuple(len(angles) for angles in self.angles)
        nodes = np.stack(np.meshgrid(*[_NODES] * NUM_JOINTS, indexing="ij"), -1).reshape(-1, NUM_JOINTS)
        # Block by block: the regressor of all parameters need not fit into memory at once.
        self._at_nodes = np.concatenate([self.regressor(block) for block in np.array_split(nodes, 25)])
        self._num_rows = self._at_nodes.shape[1]
        self._at_nodes = self._at_nodes.reshape(-1, self.parameters.rank)
        self._interpolation = [_dirichlet(angles) for angles in self.angles]
        # One result is kept and written again: fresh memory of this size costs more than the arithmetic.
        self._gains = np.empty((len(self) // self.shape[-1], self.shape[-1]))

    def __len__(self) -> int:
        """How many different candidates there are."""
        return int(np.prod(self.shape))

    def configurations(self, numbers: np.ndarray) -> np.ndarray:
        """Joint positions in rad of candidates, (n,) -> (n, 6)."""
        indices = np.unravel_index(numbers, self.shape)
        return np.stack([angles[i] for angles, i in zip(self.angles, indices, strict=True)], -1)

    def regressor(self, q: np.ndarray) -> np.ndarray:
        """Regressors of the identifiable parameters in m and rad, (n, 6) -> (n, 6 or 3, rank)."""
        return self.parameters.regressor(q)[:, self._rows]

    def information(self, q: np.ndarray) -> np.ndarray:
        """Information matrices Theta^T Theta of single measurements, (n, 6) -> (n, rank, rank)."""
        Theta = self.regressor(q)
        return np.swapaxes(Theta, -1, -2) @ Theta

    def screen(self, root: np.ndarray) -> np.ndarray:
        """tr(W Theta^T Theta) of every candidate, for W = root root^T.

        Args:
            root: shape (rank, any).

        Returns:
            Shape (len(self),), in the order of the numbers; overwritten by the next call.
        """
        gains = np.square(self._at_nodes @ root).sum(axis=1).reshape(-1, self._num_rows).sum(axis=1)
        for matrix in self._interpolation[:-1]:
            # The joint that stands first is interpolated and put last: six times is once around.
            gains = gains.reshape(len(_NODES), -1).T @ matrix.T
        np.matmul(gains.reshape(len(_NODES), -1).T, self._interpolation[-1].T, out=self._gains)
        return self._gains.reshape(-1)


def _dirichlet(angles: np.ndarray) -> np.ndarray:
    """From the values of a trigonometric polynomial at the nodes to those at some angles, (n, 5)."""
    distance = angles[:, None] - _NODES
    harmonics = [2.0 * np.cos(k * distance) for k in range(1, _DEGREE + 1)]
    return (1.0 + np.sum(harmonics, axis=0)) / len(_NODES)
