"""A path as a line in space, without its timing: how far a point is along it, and how far beside it.

The frame of the path P is the one that controllers use for path corrections: x along the path, z as near to
the z axis of the tool as that allows, y = z x x.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from systems.reference.cartesian_path import CartesianPath

_SPACING = 5e-4  # m, between points of the line
_SAMPLING = 2e-3  # s, at which the path is looked at; it moves far less than the spacing in that
_LOOK_BACK, _LOOK_AHEAD = 0.01, 0.05  # m, about the last place: a path may cross itself
_STEP_AHEAD = 0.005  # m, between two reports of a controller: 1.2 m/s at 4 ms; after a gap it catches up
_LEAST_ANGLE = 0.1  # of directions, below which z of the tool says nothing


class Place(NamedTuple):
    """Where a point is beside a path."""

    index: int  # of the nearest point of the line, all laps counted, for the next look
    along: float  # m, from the start
    R_WP: np.ndarray  # (3, 3), axes of the path's frame in the world
    p_error_W: np.ndarray  # (3,) m, from the point to the line, at a right angle to it


class PathLine:
    """Points of a path at even distances, with a frame at each.

    Attributes:
        along: m from the start of a lap, shape (n,). All laps are the same, and only one is kept.
        points: of a lap, (n, 3) in m.
        R_WP: axes of the path's frame at these in the world, (n, 3, 3).
    """

    def __init__(self, path: CartesianPath) -> None:
        """Samples the path.

        Raises:
            ValueError: if the tool only turns on the spot, so that there is nothing beside the path.
        """
        self._laps = len(path.lap_starts)
        end = path.lap_end
        times = np.arange(path.path_start, end + _SAMPLING, _SAMPLING)
        X_WE = path.sample(np.minimum(times, end))[0]
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(X_WE[:, :3, 3], axis=0), axis=1))])
        if way[-1] < 2.0 * _SPACING:
            raise ValueError("path correction: the path has no length, the tool only turns on the spot")
        moves = np.concatenate([[True], np.diff(way) > 0.0])
        self.along = np.linspace(0.0, way[-1], int(np.ceil(way[-1] / _SPACING)) + 1)
        points = X_WE[moves][:, :3, 3]
        self.points = np.stack([np.interp(self.along, way[moves], column) for column in points.T], -1)
        nearest = np.searchsorted(way[moves], self.along).clip(max=len(points) - 1)
        tangent = np.diff(self.points, axis=0, append=2.0 * self.points[-1:] - self.points[-2:-1])
        self.R_WP = _frames(tangent, X_WE[moves][nearest, :3, 2], X_WE[moves][nearest, :3, 0])

    @property
    def length(self) -> float:
        """Of the path with all its laps in m."""
        return self._laps * float(self.along[-1])

    def row(self, index: Any) -> tuple[Any, Any]:
        """Which row of a lap a point of the line is, and of which lap: the end is that of the last one."""
        steps = len(self.along) - 1
        lap = np.minimum(index // steps, self._laps - 1)
        return index - lap * steps, lap

    def way_to(self, index: int) -> float:
        """How far a point of the line is from the start, in m."""
        row, lap = self.row(index)
        return float(self.along[row] + lap * self.along[-1])

    def place(self, p_WE: np.ndarray, last: int) -> Place:
        """Where a point (3,) in m is, not far from the point of the line where it was last."""
        return self._nearest(p_WE, max(0, last - self._steps(_LOOK_BACK)), last + self._steps(_LOOK_AHEAD))

    def shifted(self, p_WE: np.ndarray, last: int, shifts: Callable[[np.ndarray], np.ndarray]) -> Place:
        """Where on its way a robot is that has been shifted beside the path; it never goes back.

        Args:
            p_WE: its tool (3,) in m.
            last: index of the last place.
            shifts: from frames R_WP of the path (n, 3, 3), in which the robot may be, to the shifts (n, 3) in
                m in the world that it would have in them.
        """
        return self._nearest(p_WE, last, last + self._steps(_STEP_AHEAD), shifts)

    def _nearest(
        self,
        p_WE: np.ndarray,
        first: int,
        end: int,
        shifts: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> Place:
        among = np.arange(first, min(end, self._laps * (len(self.along) - 1) + 1))
        rows, _ = self.row(among)
        near = self.points[rows] + (shifts(self.R_WP[rows]) if shifts else 0.0)
        k = int(np.argmin(((near - p_WE) ** 2).sum(axis=1)))
        index, R_WP, error = int(among[k]), self.R_WP[rows[k]], self.points[rows[k]] - p_WE
        tangent = R_WP[:, 0]
        return Place(index, self.way_to(index), R_WP, error - (tangent @ error) * tangent)

    def _steps(self, way: float) -> int:
        return int(way / self.along[1]) + 1


def _frames(tangent: np.ndarray, z_tool: np.ndarray, x_tool: np.ndarray) -> np.ndarray:
    """Right-handed axes (n, 3, 3) from directions (n, 3), those of the tool being unit vectors."""
    x = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    y = np.cross(z_tool, x)
    says = np.linalg.norm(y, axis=1) > _LEAST_ANGLE
    # Where the tool moves along its own axis, y stays as it is next to there; where it does so on a whole
    # edge, the x axis of the tool takes the place of z.
    for way in (range(1, len(y)), range(len(y) - 2, -1, -1)):
        for k in way:
            before = k - way.step
            if (
                not says[k]
                and says[before]
                and abs(x[k] @ y[before]) < _LEAST_ANGLE * np.linalg.norm(y[before])
            ):
                y[k], says[k] = y[before] - (x[k] @ y[before]) * x[k], True
    y = np.where(says[:, None], y, np.cross(x_tool, x))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], -1)
