"""Transmission zeros of mechanical systems, and of elastic robots from their motors to their tool.

The zeros of M x'' + D x' + K x = B u with the output y = C x are the motions that the inputs can make while
the output stands still: the poles of the exact inverse. One with a positive real part makes that inverse
unstable, so that no causal feedforward can be exact (Reiner (2010), sections 3.2 and 3.3).
"""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.linalg import eig, null_space

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.load_stiffness import load_stiffness
from robots.dynamics.plant import add_robot

# 1/s; where massless parts stand between input and output, zeros lie at infinity, and rounding brings them
# back to 1e7 and more. The fastest spring and damper of a robot have some 1e4.
_INFINITE = 1e6
_SINGULAR = 1e-6  # of the largest singular value, with turns in rad and motions in m


@dataclass(frozen=True)
class Zeros:
    """The finite zeros of one system."""

    values: np.ndarray  # (k,) complex, 1/s, by real part
    relative_degree: int  # poles less zeros: how many derivatives of the output the inverse needs in all

    @property
    def unstable(self) -> np.ndarray:
        """Those in the right half-plane, (j,) complex in 1/s, without undamped pairs that rounding moves."""
        return self.values[np.real(self.values) > 1e-6 * (1.0 + np.abs(self.values))]

    @property
    def is_minimum_phase(self) -> bool:
        """Whether the exact inverse is stable."""
        return not len(self.unstable)

    @property
    def slowest_rhp(self) -> float | None:
        """The smallest real part in the right half-plane in 1/s, None if there is none.

        How slowly the exact inverse diverges; where the zero is real, it bounds the bandwidth, too.
        """
        return float(np.real(self.unstable).min()) if len(self.unstable) else None


def transmission_zeros(M: np.ndarray, D: np.ndarray, K: np.ndarray, B: np.ndarray, C: np.ndarray) -> Zeros:
    """The zeros of M x'' + D x' + K x = B u, y = C x, for as many outputs as inputs.

    The rows that the inputs act on are annihilated and x is restricted to the kernel of the output; what
    remains is a quadratic eigenvalue problem of the size n - p, solved as a linear one of twice the size.

    Args:
        M: mass matrix, shape (n, n).
        D: damping, shape (n, n).
        K: stiffness, shape (n, n).
        B: inputs, shape (n, p).
        C: outputs, shape (p, n).

    Raises:
        ValueError: if the shapes do not fit, or inputs or outputs depend on each other.
    """
    n, p = B.shape
    if not M.shape == D.shape == K.shape == (n, n) or C.shape != (p, n):
        raise ValueError(
            f"transmission zeros: M, D, K must be {n} x {n} and C {p} x {n} for B of {n} x {p}, got "
            f"{M.shape}, {D.shape}, {K.shape}, {C.shape}"
        )
    for name, matrix in (("inputs", B), ("outputs", C)):
        singular = np.linalg.svd(matrix, compute_uv=False)
        if singular[-1] < _SINGULAR * singular[0]:
            raise ValueError(f"transmission zeros: the {name} depend on each other, rank below {p}")
    left, right = null_space(B.T).T, null_space(C)
    mass, damping, stiffness = left @ M @ right, left @ D @ right, left @ K @ right
    # In a unit of time in which mass and stiffness weigh the same, the two halves of the pencil are alike.
    rate = np.sqrt(np.linalg.norm(K) / np.linalg.norm(M)) if K.any() else 1.0
    identity, zero = np.eye(n - p), np.zeros((n - p, n - p))
    pencil = np.block([[zero, identity], [-stiffness, -rate * damping]])
    weights = np.block([[identity, zero], [zero, rate**2 * mass]])
    values = np.asarray(eig(pencil, weights, right=False))
    values = rate * values[np.isfinite(values)]
    values = values[np.abs(values) < _INFINITE]
    return Zeros(values[np.argsort(np.real(values))], 2 * n - len(values))


class ZeroAnalysis:
    """The zeros of one robot from the torques of its motors to the pose of its tool.

    Linearised about rest with the sag of gears and structure, and with the stiffness that gravity and
    counterbalance have there.
    """

    def __init__(self, robot: RobotModel, elasticity: str = "structure", payload: float = 0.0) -> None:
        """Builds the plant.

        Args:
            robot: whose zeros.
            elasticity: ``"joints"`` or ``"structure"``.
            payload: mass at the flange in kg.

        Raises:
            ValueError: if the elasticity is unknown or rigid, or the robot may not carry the payload.
        """
        if elasticity == "rigid":
            raise ValueError("zeros: a rigid robot has none; elasticity must be joints or structure")
        self._plant = MultibodyPlant(0.0)
        self._parts = add_robot(self._plant, robot, elasticity, payload)
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        n = self._plant.num_positions()
        self._motors = [joint.position_start() for joint in self._parts.motors]
        self._sprung = [joint.position_start() for joint in self._parts.sprung]
        self._D = np.zeros((n, n))
        for joint in (*self._parts.motors, *self._parts.sprung):
            row = joint.velocity_start()
            self._D[row, row] = joint.default_damping()
        self._B = np.zeros((n, NUM_JOINTS))
        self._B[self._motors, range(NUM_JOINTS)] = 1.0

    def at(self, theta: np.ndarray) -> Zeros:
        """The zeros with the motors at theta (rad, shape (6,)).

        Raises:
            ValueError: if theta is singular: the tool cannot move in every direction there.
        """
        self._parts.set_at_rest(self._context, np.asarray(theta, dtype=float))
        M = self._plant.CalcMassMatrix(self._context)
        world = self._plant.world_frame()
        J = self._plant.CalcJacobianSpatialVelocity(
            self._context, JacobianWrtVariable.kV, self._parts.tool, np.zeros(3), world, world
        )
        singular = np.linalg.svd(J[:, self._motors], compute_uv=False)
        if singular[-1] < 1e-3 * singular[0]:
            raise ValueError(f"zeros: singular with the motors at {np.rad2deg(theta).round(1).tolist()} deg")
        return transmission_zeros(M, self._D, self._stiffness(), self._B, J)

    def _stiffness(self) -> np.ndarray:
        """Springs, and what gravity and counterbalance add, in N m / rad."""
        rest = self._plant.GetPositions(self._context)
        stiffness = load_stiffness(self._parts, self._context, range(len(rest)))
        stiffness[self._sprung, self._sprung] += self._parts.tangent_stiffness(rest[self._sprung])
        return stiffness
