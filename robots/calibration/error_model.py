"""The complete error model: every placement of a robot displaced in all six directions, every zero shifted.

The pose of the tool is

    X_WE = prod_i  P_i  T(t_i)  exp(w_i~)  Rot(a_i, (1 + k_i) q_i + z_i),   i = base, 1 ... 6, tool,

with the nominal placements P_i and axes a_i of the robot file; base and tool have no joint. These are 54
parameters, and those of `robots.description.joint_errors` where they are asked for, such as scales k_i. They
are redundant on purpose: whatever frames were chosen to draw the robot, they span all small changes of its
geometry, and a prior decides between changes that no measurement can tell apart.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robots.description.joint_errors import JointErrors, names_of
from robots.description.model import NUM_JOINTS, Placement, RobotModel
from robots.kinematics.forward import rotation_about
from robots.pose import zyx_from_rotation

PLACEMENTS = ("base", *(f"joint{number}" for number in range(1, NUM_JOINTS + 1)), "tool")
_PLACED = tuple(f"{part}_{kind}" for part in PLACEMENTS for kind in ("x", "y", "z", "rx", "ry", "rz"))
_ZEROS = tuple(f"zero_{number}" for number in range(1, NUM_JOINTS + 1))
NUM_PLACED = len(_PLACED)  # 48
ZEROS = slice(NUM_PLACED, NUM_PLACED + NUM_JOINTS)
_NUM_DRAWN = NUM_PLACED + NUM_JOINTS  # 54; what follows has no place in a drawing

_EYE = np.eye(3)
_SMALL = 1e-5  # rad, below which the series of sin and cos have all digits


@dataclass(frozen=True)
class Chain:
    """Where everything is at n configurations, in the world."""

    X_WE: np.ndarray  # (n, 4, 4) tool
    R_WL: np.ndarray  # (6, n, 3, 3) links, behind their joints
    p_WL: np.ndarray  # (6, n, 3) m, their origins, which lie on the axes
    axes: np.ndarray  # (6, n, 3) unit vectors along the axes


class ErrorModel:
    """Forward kinematics of a robot at any value of its error parameters, and its exact derivative.

    Parameters x are one vector, in m and rad, in the order of `names`: ``base_x``, ``base_y``, ``base_z``,
    ``base_rx``, ... ``tool_rz`` for the placements (displaced along and turned about the axes of the placed
    frame), ``zero_1`` ... ``zero_6`` for the zero points of the joints, then the errors of joints.
    """

    def __init__(self, robot: RobotModel, joint_errors: Sequence[str] = ()) -> None:
        """Takes the placements of a robot as nominal.

        Args:
            robot: any robot of six revolute joints.
            joint_errors: kinds of `robots.description.joint_errors.KINDS` that are parameters, too.
        """
        self.robot = robot
        self.joint_errors = names_of(joint_errors)
        self.names = _PLACED + _ZEROS + self.joint_errors
        self._errors = JointErrors(self.joint_errors, robot.gear_ratio)
        poses = [
            part.pose().GetAsMatrix4()
            for part in (robot.base, *(joint.placement for joint in robot.joints), robot.tool)
        ]
        self._R = [X[:3, :3] for X in poses]
        self._p = [X[:3, 3] for X in poses]
        self._axes = robot.axes
        self._skew = [np.cross(_EYE, axis) for axis in self._axes]  # a~ v = a x v

    def __len__(self) -> int:
        """How many parameters there are."""
        return len(self.names)

    def forward(self, q: np.ndarray, x: np.ndarray, read: np.ndarray | None = None) -> np.ndarray:
        """Tool poses X_WE, (n, 6) in rad -> (n, 4, 4). Raises ValueError for other shapes.

        Errors of the joints depend on the positions that are ``read``, those of the motors; None for q.
        """
        return self._evaluate(q, x, read, with_regressor=False)[0].X_WE

    def chain(self, q: np.ndarray, x: np.ndarray, read: np.ndarray | None = None) -> Chain:
        """Where the tool and all links stand, as `forward`. Raises ValueError for other shapes."""
        return self._evaluate(q, x, read, with_regressor=False)[0]

    def forward_and_regressor(self, q: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tool poses (n, 4, 4) and regressors (n, 6, len(self)).

        The pose moves as a spatial vector in world axes, a rotation vector in rad above a translation in m:
        d(pose) = regressor dx. Raises ValueError for other shapes.
        """
        chain, Theta = self.chain_and_regressor(q, x)
        return chain.X_WE, Theta

    def chain_and_regressor(
        self, q: np.ndarray, x: np.ndarray, read: np.ndarray | None = None
    ) -> tuple[Chain, np.ndarray]:
        """As `forward_and_regressor`, with the places of all links; ``read`` as in `forward`."""
        chain, Theta = self._evaluate(q, x, read, with_regressor=True)
        assert Theta is not None
        return chain, Theta

    def robot_with_errors(self, x: np.ndarray) -> RobotModel:
        """The robot whose drawing is the one with errors: a robot file with corrected placements.

        Args:
            x: parameters, shape (len(self),).

        Returns:
            A robot with ``Kinematics(robot).forward(q)`` equal to `forward` (q, x) up to rounding; errors of
            joints have no place in a drawing and are left out.
        """
        placed, zeros = x[:NUM_PLACED].reshape(-1, 2, 3), x[ZEROS]
        nominal = [self.robot.base, *(joint.placement for joint in self.robot.joints), self.robot.tool]
        corrected = []
        for body, ((t, w), placement) in enumerate(zip(placed, nominal, strict=True)):
            R = self._R[body] @ exponential(w)[0]
            if 0 < body <= NUM_JOINTS:
                R = R @ rotation_about(self._axes[body - 1], zeros[body - 1])
            zyx_deg = np.rad2deg(zyx_from_rotation(R))
            source = f"with geometric errors; {placement.source}"
            corrected.append(Placement(self._p[body] + self._R[body] @ t, zyx_deg, source))
        joints = [
            replace(joint, placement=placement)
            for joint, placement in zip(self.robot.joints, corrected[1:-1], strict=True)
        ]
        return replace(self.robot, base=corrected[0], joints=joints, tool=corrected[-1])

    def _evaluate(
        self, q: np.ndarray, x: np.ndarray, read: np.ndarray | None, with_regressor: bool
    ) -> tuple[Chain, np.ndarray | None]:
        q, x = np.asarray(q, dtype=float), np.asarray(x, dtype=float)
        if q.ndim != 2 or q.shape[1] != NUM_JOINTS:
            raise ValueError(f"joint positions must have the shape (n, {NUM_JOINTS}), got {q.shape}")
        if x.shape != (len(self),):
            raise ValueError(f"error parameters must have the shape ({len(self)},), got {x.shape}")
        placed, zeros = x[:NUM_PLACED].reshape(-1, 2, 3), x[ZEROS]
        angles, read = q + zeros, q if read is None else read
        if self.joint_errors:
            angles = angles + self._errors.added(read, x[_NUM_DRAWN:])
        sines, versines = np.sin(angles)[..., None, None], 1.0 - np.cos(angles)[..., None, None]
        n = len(q)
        R, p = np.broadcast_to(_EYE, (n, 3, 3)), np.zeros((n, 3))
        shifts, turns, origins, axes, R_WL = [], [], [], [], []
        for body, (t, w) in enumerate(placed):
            turn, left = exponential(w)
            p = p + R @ (self._p[body] + self._R[body] @ t)
            origins.append(p)
            if with_regressor:
                shifts.append(_times(R, self._R[body]))
                turns.append(_times(shifts[-1], left))
            R = _times(R, self._R[body] @ turn)
            if 0 < body <= NUM_JOINTS:
                skew = self._skew[body - 1]
                axes.append(R @ self._axes[body - 1])
                bent = sines[:, body - 1] * _times(R, skew) + versines[:, body - 1] * _times(R, skew @ skew)
                R = R + bent
                R_WL.append(R)
        X = np.zeros((n, 4, 4))
        X[:, :3, :3], X[:, :3, 3], X[:, 3, 3] = R, p, 1.0
        chain = Chain(X, np.array(R_WL), np.array(origins[1:-1]), np.array(axes))
        return chain, self._regressor(read, chain, shifts, turns, origins) if with_regressor else None

    def _regressor(
        self,
        read: np.ndarray,
        chain: Chain,
        shifts: list[np.ndarray],
        turns: list[np.ndarray],
        origins: list[np.ndarray],
    ) -> np.ndarray:
        """Columns [0; b] of translations along b, [w; w x (p_WE - p_Wi)] of rotations about w, (n, 6, m)."""
        n = len(read)
        Theta = np.zeros((n, 6, len(self)))
        levers = chain.X_WE[:, None, :3, 3] - np.stack(origins, 1)  # (n, 8, 3)
        placed = Theta[:, :, :NUM_PLACED].reshape(n, 6, len(PLACEMENTS), 6)  # a view
        placed[:, 3:, :, :3] = np.stack(shifts, 2)
        w = np.stack(turns, 2)  # (n, 3, 8, 3): columns of a body last
        placed[:, :3, :, 3:] = w
        placed[:, 3:, :, 3:] = _cross(w, np.swapaxes(levers, 1, 2)[..., None])
        a = np.moveaxis(chain.axes, 0, 2)  # (n, 3, 6)
        Theta[:, :3, ZEROS] = a
        Theta[:, 3:, ZEROS] = _cross(a, np.swapaxes(levers[:, 1:-1], 1, 2))
        if self.joint_errors:
            moved = Theta[:, :, ZEROS][:, :, self._errors.joint]
            Theta[:, :, _NUM_DRAWN:] = moved * self._errors.effects(read)[:, None, :]
        return Theta


def exponential(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """exp(w~) and its left Jacobian L, with d exp(w~) = (L dw)~ exp(w~), for a rotation vector in rad.

    Returns:
        Two matrices (3, 3).
    """
    x, y, z = w.tolist()
    angle, skew = math.sqrt(x * x + y * y + z * z), np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < _SMALL:
        a, b, c = 1.0 - angle**2 / 6.0, 0.5 - angle**2 / 24.0, 1.0 / 6.0 - angle**2 / 120.0
    else:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
        c = (angle - math.sin(angle)) / angle**3
    square = skew @ skew
    return _EYE + a * skew + b * square, _EYE + b * skew + c * square


def _times(R: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """R columns for rotations (n, 3, 3) and one matrix (3, 3): a single product of matrices."""
    return (R.reshape(-1, 3) @ columns).reshape(R.shape)


def _cross(w: np.ndarray, d: np.ndarray) -> np.ndarray:
    """w x d for vectors along axis 1."""
    wx, wy, wz = w[:, 0], w[:, 1], w[:, 2]
    dx, dy, dz = d[:, 0], d[:, 1], d[:, 2]
    return np.stack([wy * dz - wz * dy, wz * dx - wx * dz, wx * dy - wy * dx], 1)
