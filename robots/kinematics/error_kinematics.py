"""Exact kinematics of a robot with wrong geometry, and its derivative by the 48 error parameters.

The pose of every body in the one before it is

    Trans(l + pl)  R  exp(x a) exp(y b) exp(z g)  exp(n (q + p_q))  exp(x a) exp(y b) exp(z g),

with the nominal translation l, rotation R and axis n of the robot file. Of the six rotation errors a joint
has two, `error_parameters` says which; the base has the three before a joint that it does not have. The
tool has R(alpha + p_alpha_E, beta + p_beta_E, gamma + p_gamma_E) in ZYX Euler angles. Rotations are exact,
not linearised: the linear form of Probst (2024) eq. (2.49) leaves the rotation group.
"""

from dataclasses import replace

import numpy as np

from robots.description.error_parameters import (
    AFTER,
    BEFORE,
    FRAMES,
    NUM_PARAMETERS,
    OFFSETS,
    SHIFT,
    TOOL,
    checked,
    error_parameters,
)
from robots.description.model import NUM_JOINTS, Placement, RobotModel
from robots.kinematics.forward import rotation_about
from robots.pose import zyx_from_rotation

_EYE = np.eye(3)


class ErrorKinematics:
    """Forward kinematics, Jacobian and regressor of a robot at any value of its error parameters.

    Configurations q have any leading shape (..., 6), in rad; the parameters p are one vector (48,), in m
    and rad, in the order of `error_parameters`. All methods raise ValueError for other shapes.
    """

    def __init__(self, robot: RobotModel) -> None:
        self.robot = robot
        self.parameters = error_parameters(robot)
        self._shifts = [self._indices(body, SHIFT) for body in range(len(FRAMES))]
        self._before = [self._indices(body, BEFORE) for body in range(len(FRAMES))]
        self._after = [self._indices(body, AFTER) for body in range(len(FRAMES))]
        placements = [robot.base, *(joint.placement for joint in robot.joints)]
        self._l = [placement.translation for placement in (*placements, robot.tool)]
        self._R = [placement.pose().rotation().matrix() for placement in placements]
        # The tool has no rotation but its Euler angles, and the errors are added to these.
        self._R.append(_EYE)
        self._nominal = np.zeros(NUM_PARAMETERS)
        self._nominal[self._before[TOOL]] = np.deg2rad(robot.tool.zyx_deg)
        # exp(n q) = cos(q) (I - n n^T) + sin(q) n~ + n n^T
        self._along = [np.outer(n, n) for n in robot.axes]
        self._skew = [np.cross(_EYE, n) for n in robot.axes]

    def forward(self, q: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Tool poses X_WE, Probst (2024) eq. (2.50); homogeneous matrices of shape (..., 4, 4)."""
        return self._evaluate(q, p, with_regressor=False)[0]

    def jacobian(self, q: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Geometric Jacobians J with V_WE = J dq/dt, Probst (2024) eq. (2.51).

        Returns:
            Shape (..., 6, 6); rows are rotation (rad/s), then translation (m/s).
        """
        # A joint and its offset turn the tool in the same way.
        return self.regressor(q, p)[..., OFFSETS]

    def regressor(self, q: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Regressors Theta, Probst (2024) eq. (2.52), at any p: d(pose of the tool) = Theta dp.

        The pose moves as a spatial vector in world axes: a rotation vector in rad, then a translation in
        m. The column of a rotation about w through the point p_Wi is [w; w x (p_WE - p_Wi)], that of a
        translation along b is [0; b].

        Returns:
            Shape (..., 6, 48).
        """
        return self.forward_and_regressor(q, p)[1]

    def forward_and_regressor(self, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tool poses (..., 4, 4) and regressors (..., 6, 48) in one pass."""
        X, Theta = self._evaluate(q, p, with_regressor=True)
        assert Theta is not None
        return X, Theta

    def _indices(self, body: int, kind: str) -> list[int]:
        return [i for i, entry in enumerate(self.parameters) if entry.body == body and entry.kind == kind]

    def _turns(self, start: np.ndarray, indices: list[int], p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A rotation followed by elementary ones, and the axes of these as columns, before they turn."""
        R, axes = start, np.empty((3, len(indices)))
        for column, index in enumerate(indices):
            axis = self.parameters[index].axis
            axes[:, column] = R[:, axis]
            R = R @ rotation_about(_EYE[axis], p[index])
        return R, axes

    def _evaluate(
        self, q: np.ndarray, p: np.ndarray, with_regressor: bool
    ) -> tuple[np.ndarray, np.ndarray | None]:
        q, p = np.asarray(q, dtype=float), checked(p)
        if q.shape[-1:] != (NUM_JOINTS,):
            raise ValueError(f"joint positions must have the shape (..., {NUM_JOINTS}), got {q.shape}")
        flat = q.reshape(-1, NUM_JOINTS)
        n, batch = len(flat), q.shape[:-1]
        angles = flat + p[OFFSETS]
        sines, cosines = np.sin(angles)[..., None, None], np.cos(angles)[..., None, None]
        p = p + self._nominal
        Theta = np.zeros((n, 6, NUM_PARAMETERS)) if with_regressor else None
        R_WS, p_WS = np.broadcast_to(_EYE, (n, 3, 3)), np.zeros((n, 3))
        origins = []
        for body in range(len(FRAMES)):
            shifts, before, after = self._shifts[body], self._before[body], self._after[body]
            p_WS = p_WS + R_WS @ (self._l[body] + p[shifts])
            origins.append(p_WS)
            R_before, before_axes = self._turns(self._R[body], before, p)
            if Theta is not None:
                Theta[:, 3:, shifts] = R_WS
                Theta[:, :3, before] = _times(R_WS, before_axes)
            R_WS = _times(R_WS, R_before)
            if 0 < body < TOOL:
                i = body - 1
                across = _times(R_WS, _EYE - self._along[i])
                R_WS = (
                    cosines[:, i] * across
                    + sines[:, i] * _times(R_WS, self._skew[i])
                    + _times(R_WS, self._along[i])
                )
                R_after, after_axes = self._turns(_EYE, after, p)
                if Theta is not None:
                    Theta[:, :3, i] = R_WS @ self.robot.axes[i]
                    Theta[:, :3, after] = _times(R_WS, after_axes)
                R_WS = _times(R_WS, R_after)
        X = np.zeros((n, 4, 4))
        X[:, :3, :3], X[:, :3, 3], X[:, 3, 3] = R_WS, p_WS, 1.0
        if Theta is None:
            return X.reshape(*batch, 4, 4), None
        self._add_levers(Theta, p_WS, origins)
        return X.reshape(*batch, 4, 4), Theta.reshape(*batch, 6, NUM_PARAMETERS)

    def _add_levers(self, Theta: np.ndarray, p_WE: np.ndarray, origins: list[np.ndarray]) -> None:
        """Completes the columns of the rotations by w x (p_WE - p_Wi)."""
        for body, p_WS in enumerate(origins):
            turns = [*self._before[body], *self._after[body]] + ([body - 1] if 0 < body < TOOL else [])
            wx, wy, wz = np.moveaxis(Theta[:, :3, turns], 1, 0)
            dx, dy, dz = (p_WE - p_WS).T[..., None]
            Theta[:, 3, turns] = wy * dz - wz * dy
            Theta[:, 4, turns] = wz * dx - wx * dz
            Theta[:, 5, turns] = wx * dy - wy * dx

    def robot_with_errors(self, p: np.ndarray) -> RobotModel:
        """The robot whose nominal geometry is the one with errors, frame by frame.

        What turns a link behind its joint goes into the placement of the next one, and the joint's offset
        into its own placement. So a true robot or a calibrated one is a robot file like any other.

        Args:
            p: parameters, shape (48,).

        Returns:
            A robot with ``Kinematics(robot).forward(q)`` equal to `forward` (q, p) up to rounding.
        """
        p = checked(p)
        angles = p + self._nominal
        placements = []
        R_after = _EYE  # from the frame that the joint turns to the one that the next translation is in
        nominal = [self.robot.base, *(joint.placement for joint in self.robot.joints), self.robot.tool]
        for body, placement in enumerate(nominal):
            translation = R_after @ (placement.translation + p[self._shifts[body]])
            R, _ = self._turns(R_after @ self._R[body], self._before[body], angles)
            R_after = _EYE
            if 0 < body < TOOL:
                R = R @ rotation_about(self.robot.axes[body - 1], p[body - 1])
                R_after, _ = self._turns(_EYE, self._after[body], angles)
            zyx_deg = np.rad2deg(zyx_from_rotation(R))
            placements.append(Placement(translation, zyx_deg, f"with geometric errors; {placement.source}"))
        joints = [
            replace(joint, placement=placement)
            for joint, placement in zip(self.robot.joints, placements[1:-1], strict=True)
        ]
        return replace(self.robot, base=placements[0], joints=joints, tool=placements[-1])


def _times(R: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """R columns for rotations (n, 3, 3) and one matrix (3, m): a single product of matrices."""
    return (R.reshape(-1, 3) @ columns).reshape(len(R), 3, columns.shape[1])
