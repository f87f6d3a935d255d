"""Forward kinematics, Jacobian and their robust inverse, for one configuration or a hundred thousand.

Batches have any leading shape: configurations (..., 6) in, poses (..., 4, 4) and Jacobians (..., 6, 6)
out. One configuration takes about 10 us, 1e5 configurations some tens of milliseconds.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs

from robots.model import NUM_JOINTS, RobotModel

DAMPING = 1e-4  # alpha_0 of Probst (2024) eq. (2.33)
MANIPULABILITY_THRESHOLD = 1e-4  # w_0 of the same equation

_ROUNDING = 1e-15  # direction cosines and lengths below this come from turning degrees into radians
_BLOCK = 2048  # configurations at a time, so that the intermediate arrays stay in the cache

# The coordinates of a vector: floats for one configuration, arrays of one length for a block of them.
Vector = tuple[Any, Any, Any]


class _Step(NamedTuple):
    """From one link to the next: along ``offset``, through the constant ``turn``, about axis ``k``.

    The offset holds only the components that are not zero, as (index, length); i and j are the axes after k.
    """

    offset: tuple[tuple[int, float], ...]
    turn: list[list[float]] | None
    i: int
    j: int
    k: int


class Kinematics:
    """The nominal kinematics of a robot, with its tool, in the world frame.

    The links get working frames that are parallel to the base at zero joint angles. In these a robot of
    the usual kind turns about coordinate axes only, which moves two columns of a rotation matrix and
    leaves the third; no constant rotations remain between the joints. A joint about any other axis gets
    a frame of its own, turned so that its axis becomes z.
    """

    def __init__(self, robot: RobotModel) -> None:
        self.robot = robot
        X_WB = robot.base.pose()
        self._R_WB: list[Vector] = [tuple(column) for column in X_WB.rotation().matrix().T.tolist()]
        self._p_WB: Vector = tuple(X_WB.translation().tolist())
        self._joints: list[_Step] = []
        R_BL = np.eye(3)  # the frame of the link at zero joint angles, as the robot file has it
        R_BS = np.eye(3)  # its working frame
        for joint, axis in zip(robot.joints, robot.axes, strict=True):
            offset = _nonzero(R_BS.T @ R_BL @ joint.placement.translation)
            R_BL = R_BL @ joint.placement.pose().rotation().matrix()
            axis_S = R_BS.T @ R_BL @ axis
            k = int(np.argmax(axis_S))
            if np.abs(axis_S - np.eye(3)[k]).max() < _ROUNDING:
                self._joints.append(_Step(offset, None, (k + 1) % 3, (k + 2) % 3, k))
                continue
            turn = _z_to(axis_S)
            R_BS = R_BS @ turn
            self._joints.append(_Step(offset, turn.tolist(), 0, 1, 2))
        X_FE = robot.tool.pose()
        R_SF = R_BS.T @ R_BL
        self._p_SE = _nonzero(R_SF @ X_FE.translation())
        self._R_SE = (R_SF @ X_FE.rotation().matrix()).tolist()

    def _chain(self, sines: Any, cosines: Any) -> tuple[list[Vector], Vector, list[Vector], list[Vector]]:
        """The columns of R_WE, p_WE, and the axes and origins of the joints in the world."""
        columns, p = list(self._R_WB), self._p_WB
        axes, origins = [], []
        for (offset, turn, i, j, k), s, c in zip(self._joints, sines, cosines, strict=True):
            if offset:
                p = _moved(p, columns, offset)
            if turn is not None:
                columns = _turned(columns, turn)
            (ux, uy, uz), (vx, vy, vz) = columns[i], columns[j]
            columns[i] = (c * ux + s * vx, c * uy + s * vy, c * uz + s * vz)
            columns[j] = (c * vx - s * ux, c * vy - s * uy, c * vz - s * uz)
            axes.append(columns[k])
            origins.append(p)
        p_WE = _moved(p, columns, self._p_SE) if self._p_SE else p
        return _turned(columns, self._R_SE), p_WE, axes, origins

    def forward(self, q: np.ndarray) -> np.ndarray:
        """Tool poses X_WE, Probst (2024) eqs. (2.3) to (2.8).

        Args:
            q: joint positions in rad, shape (..., 6).

        Returns:
            Homogeneous matrices, shape (..., 4, 4).

        Raises:
            ValueError: if the last axis of ``q`` is not six long.
        """
        return self._evaluate(q, with_jacobian=False)[0]

    def forward_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tool poses and geometric Jacobians J with V_WE = J dq/dt, Probst (2024) eq. (2.12).

        Args:
            q: joint positions in rad, shape (..., 6).

        Returns:
            Poses (..., 4, 4) and Jacobians (..., 6, 6); rows are rotation (rad/s), then translation (m/s).

        Raises:
            ValueError: if the last axis of ``q`` is not six long.
        """
        X, J = self._evaluate(q, with_jacobian=True)
        assert J is not None
        return X, J

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Geometric Jacobians, shape (..., 6, 6); see `forward_and_jacobian`."""
        return self.forward_and_jacobian(q)[1]

    def _evaluate(self, q: np.ndarray, with_jacobian: bool) -> tuple[np.ndarray, np.ndarray | None]:
        q = np.asarray(q, dtype=float)
        if q.shape[-1:] != (NUM_JOINTS,):
            raise ValueError(f"joint positions must have the shape (..., {NUM_JOINTS}), got {q.shape}")
        if q.ndim == 1:
            angles = q.tolist()
            chain = self._chain([math.sin(a) for a in angles], [math.cos(a) for a in angles])
            (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = chain[0]
            px, py, pz = chain[1]
            X = np.array([xx, yx, zx, px, xy, yy, zy, py, xz, yz, zz, pz, 0.0, 0.0, 0.0, 1.0]).reshape(4, 4)
            if not with_jacobian:
                return X, None
            return X, np.array(_jacobian_entries(*chain[1:])).reshape(NUM_JOINTS, 6).T
        flat = q.reshape(-1, NUM_JOINTS)
        X = np.zeros((len(flat), 4, 4))
        X[:, 3, 3] = 1.0
        J = np.empty((len(flat), 6, NUM_JOINTS)) if with_jacobian else None
        for start in range(0, len(flat), _BLOCK):
            block = slice(start, start + _BLOCK)
            angles = np.ascontiguousarray(flat[block].T)
            columns, p, axes, origins = self._chain(np.sin(angles), np.cos(angles))
            for i, column in enumerate((*columns, p)):
                for k in range(3):
                    X[block, k, i] = column[k]
            if J is not None:
                for entry, value in enumerate(_jacobian_entries(p, axes, origins)):
                    J[block, entry % 6, entry // 6] = value
        return X.reshape(*q.shape[:-1], 4, 4), None if J is None else J.reshape(*q.shape[:-1], 6, NUM_JOINTS)


def _nonzero(vector: np.ndarray) -> tuple[tuple[int, float], ...]:
    return tuple((k, length) for k, length in enumerate(vector.tolist()) if abs(length) > _ROUNDING)


def _z_to(axis: np.ndarray) -> np.ndarray:
    """A rotation whose third column is the given unit vector."""
    helper = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    x = helper / np.linalg.norm(helper)
    return np.column_stack([x, np.cross(axis, x), axis])


def _moved(p: Vector, columns: list[Vector], offset: tuple[tuple[int, float], ...]) -> Vector:
    """p + R offset, for the columns of R."""
    x, y, z = p
    for k, length in offset:
        cx, cy, cz = columns[k]
        x, y, z = x + length * cx, y + length * cy, z + length * cz
    return x, y, z


def _turned(columns: list[Vector], turn: list[list[float]]) -> list[Vector]:
    """The columns of R turn, for the columns of R."""
    (ux, uy, uz), (vx, vy, vz), (wx, wy, wz) = columns
    return [
        (ux * a + vx * b + wx * c, uy * a + vy * b + wy * c, uz * a + vz * b + wz * c)
        for a, b, c in zip(*turn, strict=True)
    ]


def _jacobian_entries(p: Vector, axes: list[Vector], origins: list[Vector]) -> list[Any]:
    """The 36 entries of the Jacobian, column by column: axis, then axis x (p - origin)."""
    px, py, pz = p
    entries = []
    for (ax, ay, az), (ox, oy, oz) in zip(axes, origins, strict=True):
        dx, dy, dz = px - ox, py - oy, pz - oz
        entries += (ax, ay, az, ay * dz - az * dy, az * dx - ax * dz, ax * dy - ay * dx)
    return entries


def manipulability(J: np.ndarray) -> np.ndarray:
    """sqrt(det(J J^T)), Probst (2024) eq. (2.32), for square Jacobians |det J|; shape (...)."""
    return np.abs(np.linalg.det(J))


def robust_inverse(
    J: np.ndarray, damping: float = DAMPING, threshold: float = MANIPULABILITY_THRESHOLD
) -> np.ndarray:
    """The damped inverse (J^T J + alpha^2 I)^-1 J^T, Probst (2024) eqs. (2.33), (2.35).

    alpha grows from zero to ``damping`` as the manipulability falls from ``threshold`` to zero; away from
    singularities the result is the exact inverse.

    Returns:
        Matrices of shape (..., 6, 6).
    """
    w = manipulability(J)
    if J.ndim == 2 and w >= threshold:
        return np.linalg.inv(J)
    alpha = damping * np.square(np.clip(1.0 - w / threshold, 0.0, 1.0))
    # By singular values, s / (s^2 + alpha^2): forming J^T J would square the condition number.
    U, s, Vt = np.linalg.svd(J)
    gain = s / (np.square(s) + np.square(alpha)[..., None] + np.finfo(float).tiny)
    return np.swapaxes(Vt, -1, -2) * gain[..., None, :] @ np.swapaxes(U, -1, -2)


_dgetrf, _dgetrs = get_lapack_funcs(("getrf", "getrs"), dtype=np.float64)


def robust_solve(J: np.ndarray, V: np.ndarray) -> np.ndarray:
    """J^+ V for one Jacobian with the robust inverse J^+, without forming it away from singularities.

    Args:
        J: Jacobian, shape (6, 6).
        V: one twist, shape (6,), or several as columns, shape (6, n).

    Returns:
        Joint velocities in the shape of V.
    """
    factors, pivots, _ = _dgetrf(J)
    # The product of the pivots is the determinant up to its sign.
    if abs(float(factors.ravel(order="K")[:: NUM_JOINTS + 1].prod())) >= MANIPULABILITY_THRESHOLD:
        return _dgetrs(factors, pivots, V)[0]
    return robust_inverse(J) @ V


def rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    """exp(axis~ angle) for a unit axis, the Euler-Rodrigues formula, Probst (2024) eq. (2.1), (3, 3)."""
    x, y, z = axis
    s, v = math.sin(angle), 1.0 - math.cos(angle)
    return np.array(
        [
            [1.0 - v * (y * y + z * z), v * x * y - s * z, v * x * z + s * y],
            [v * x * y + s * z, 1.0 - v * (x * x + z * z), v * y * z - s * x],
            [v * x * z - s * y, v * y * z + s * x, 1.0 - v * (x * x + y * y)],
        ]
    )
