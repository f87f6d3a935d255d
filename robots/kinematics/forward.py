"""Forward kinematics, Jacobian and their robust inverse, for one configuration or a hundred thousand.

Batches have any leading shape: configurations (..., 6) in, poses (..., 4, 4) and Jacobians (..., 6, 6)
out. One configuration takes about 5 us, 1e5 configurations some tens of milliseconds.
"""

import math

import numpy as np
from scipy.linalg import get_lapack_funcs

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.kinematics_codegen import kinematics_code
from robots.pose import Rows

DAMPING = 1e-4  # alpha_0 of Probst (2024) eq. (2.33)
MANIPULABILITY_THRESHOLD = 1e-4  # w_0 of the same equation

_BLOCK = 2048  # configurations at a time, so that the intermediate arrays stay in the cache


class Kinematics:
    """The nominal kinematics of a robot, with its tool, in the world frame."""

    def __init__(self, robot: RobotModel) -> None:
        self.robot = robot
        self._entries = kinematics_code(robot)

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

    def rows_and_jacobian(self, q: np.ndarray) -> tuple[Rows, np.ndarray]:
        """`forward_and_jacobian` of one configuration (6,), the pose as its first three rows."""
        a, b, c, d, e, f = q.tolist()
        sines = math.sin(a), math.sin(b), math.sin(c), math.sin(d), math.sin(e), math.sin(f)
        cosines = math.cos(a), math.cos(b), math.cos(c), math.cos(d), math.cos(e), math.cos(f)
        rows, jacobian = self._entries(*sines, *cosines)
        return rows, np.array(jacobian).reshape(NUM_JOINTS, 6).T

    def _evaluate(self, q: np.ndarray, with_jacobian: bool) -> tuple[np.ndarray, np.ndarray | None]:
        q = np.asarray(q, dtype=float)
        if q.shape[-1:] != (NUM_JOINTS,):
            raise ValueError(f"joint positions must have the shape (..., {NUM_JOINTS}), got {q.shape}")
        if q.ndim == 1:
            rows, J = self.rows_and_jacobian(q)
            return np.array((*rows, (0.0, 0.0, 0.0, 1.0))), J if with_jacobian else None
        flat = q.reshape(-1, NUM_JOINTS)
        X = np.zeros((len(flat), 4, 4))
        X[:, 3, 3] = 1.0
        J = np.empty((len(flat), 6, NUM_JOINTS)) if with_jacobian else None
        for start in range(0, len(flat), _BLOCK):
            block = slice(start, start + _BLOCK)
            angles = np.ascontiguousarray(flat[block].T)
            pose, jacobian = self._entries(*np.sin(angles), *np.cos(angles))
            for row, entries in enumerate(pose):
                for column, value in enumerate(entries):
                    X[block, row, column] = value
            if J is not None:
                for entry, value in enumerate(jacobian):
                    J[block, entry % 6, entry // 6] = value
        return X.reshape(*q.shape[:-1], 4, 4), None if J is None else J.reshape(*q.shape[:-1], 6, NUM_JOINTS)


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


(_dgesv,) = get_lapack_funcs(("gesv",), dtype=np.float64)


def robust_solve(J: np.ndarray, V: np.ndarray) -> np.ndarray:
    """J^+ V for one Jacobian with the robust inverse J^+, without forming it away from singularities.

    Args:
        J: Jacobian, shape (6, 6).
        V: one twist, shape (6,), or several as columns, shape (6, n).

    Returns:
        Joint velocities in the shape of V.
    """
    factors, _, solution, _ = _dgesv(J, V)
    a, b, c, d, e, f = factors.diagonal().tolist()
    # The product of the pivots is the determinant up to its sign.
    if abs(a * b * c * d * e * f) >= MANIPULABILITY_THRESHOLD:
        return solution
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
