"""Files of planned motions: times, poses of the tool in the world, and positions of the joints."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from robots.description.model import NUM_JOINTS
from robots.metrology.number_table import NumberTable, read_table

_POSE = 7
_COLUMNS = 1 + _POSE + NUM_JOINTS
_HEAD = "# time_s; x_m; y_m; z_m; qw; qx; qy; qz; q1_rad; q2_rad; q3_rad; q4_rad; q5_rad; q6_rad"
_EVEN = 1e-6  # s by which times may be uneven
_UNIT = 1e-3  # by which a quaternion's length may be off
_FEWEST = 8  # rows
# By which joints and poses may differ: a motion is planned with the calibrated robot or with the nominal one.
_FAR, _TURNED = 0.05, 0.1  # m, rad


@dataclass(frozen=True)
class PlannedMotion:
    """Samples of a motion, n of them, one every period.

    Attributes:
        period: s.
        positions: of the tool in the world in m, shape (n, 3).
        quaternions: w first, of unit length and without jumps of sign, shape (n, 4).
        q: positions of the joints in rad, shape (n, 6).
    """

    period: float
    positions: np.ndarray
    quaternions: np.ndarray
    q: np.ndarray


def planned_text(times: np.ndarray, X_WE: np.ndarray, q: np.ndarray) -> str:
    """The file of a motion: times in s (n,), even; poses (n, 4, 4); joints in rad (n, 6)."""
    quaternions = _continued(Rotation.from_matrix(X_WE[:, :3, :3]).as_quat(scalar_first=True))
    rows = np.column_stack([times, X_WE[:, :3, 3], quaternions, q])
    lines = ["; ".join(f"{value:.12g}" for value in row) for row in rows]
    return "\n".join([_HEAD, *lines]) + "\n"


def read_planned(path: str, forward: Callable[[np.ndarray], np.ndarray] | None = None) -> PlannedMotion:
    """Reads such a file.

    Args:
        path: of the file.
        forward: poses of the tool in the world, (n, 4, 4), at joint positions in rad, (n, 6); None for robots
            that are not known, whose joints are not compared with the poses.

    Raises:
        ValueError: if it is none, or a pose is not that of its joints; the message names file and line.
    """
    table = read_table(path)
    if table.columns != _COLUMNS:
        raise table.error(f"a planned motion has {_COLUMNS} columns ({_HEAD[2:]}), got {table.columns}")
    if len(table.values) < _FEWEST:
        raise table.error(f"a planned motion has at least {_FEWEST} rows, got {len(table.values)}")
    steps = np.diff(table.values[:, 0])
    _require(table, np.abs(steps - steps[0]) <= _EVEN, "times must be even", offset=1)
    if steps[0] <= 0.0:
        raise table.error("times must increase", [1])
    quaternions = table.values[:, 4:8]
    lengths = np.linalg.norm(quaternions, axis=1)
    _require(table, np.abs(lengths - 1.0) <= _UNIT, "qw, qx, qy, qz must have the length 1")
    if forward is not None:
        off = _apart(forward(table.values[:, 8:]), table.values[:, 1:4], quaternions)
        worst = np.max(off / [_FAR, _TURNED], axis=1)
        what = (
            "the joints do not bring the tool to the pose: the motion is of another robot, or it was changed"
        )
        _require(table, worst <= 1.0, what)
    return PlannedMotion(
        float(np.mean(steps)),
        table.values[:, 1:4],
        _continued(quaternions / lengths[:, None]),
        table.values[:, 8:],
    )


def _apart(X: np.ndarray, positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """Between poses (n, 4, 4) and those of a file, in m and rad, shape (n, 2)."""
    R = Rotation.from_quat(quaternions, scalar_first=True)
    turns = (R.inv() * Rotation.from_matrix(X[:, :3, :3])).magnitude()
    return np.column_stack([np.linalg.norm(X[:, :3, 3] - positions, axis=1), turns])


def _require(table: NumberTable, good: np.ndarray, what: str, offset: int = 0) -> None:
    if not good.all():
        raise table.error(what, [int(np.argmin(good)) + offset])


def _continued(quaternions: np.ndarray) -> np.ndarray:
    """The same rotations, each quaternion on the side of the one before."""
    turned = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    signs = np.append(1.0, np.where(np.cumsum(turned) % 2, -1.0, 1.0))
    return signs[:, None] * quaternions
