"""Files of planned motions: times, poses of the tool in the world, and positions of the joints."""

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


def read_planned(path: str) -> PlannedMotion:
    """Reads such a file.

    Raises:
        ValueError: if it is none; the message names file and line.
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
    return PlannedMotion(
        float(np.mean(steps)),
        table.values[:, 1:4],
        _continued(quaternions / lengths[:, None]),
        table.values[:, 8:],
    )


def _require(table: NumberTable, good: np.ndarray, what: str, offset: int = 0) -> None:
    if not good.all():
        raise table.error(what, [int(np.argmin(good)) + offset])


def _continued(quaternions: np.ndarray) -> np.ndarray:
    """The same rotations, each quaternion on the side of the one before."""
    turned = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    signs = np.append(1.0, np.where(np.cumsum(turned) % 2, -1.0, 1.0))
    return signs[:, None] * quaternions
