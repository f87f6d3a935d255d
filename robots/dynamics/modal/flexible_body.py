"""A body whose deformation is a sum of modes in a moving frame, by its standard input data.

Wallrapp (1994); Reiner (2010), section 2.6. What is of first order in the deformation is left out, so that
motions are small about rest. Drake's continuous MultibodyPlant has no such body; this stands beside it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from robots.dynamics.transmission_zeros import Zeros, transmission_zeros

_ROUNDING = 1e-9  # of the largest, up to which a place is on the axis and a mode moves nothing


@dataclass(frozen=True)
class FlexibleBody:
    """Integrals over a body with n modes and k nodes, in its frame of reference.

    Attributes:
        mass: in kg.
        places: of the nodes in m, shape (k, 3).
        shapes: displacement of the nodes by the modes, shape (k, 3, n).
        first_moment: mass times centre of mass in kg m, shape (3,).
        inertia: about the frame in kg m^2, shape (3, 3).
        Ct: mass of the modes times their displacement, shape (n, 3): coupling with translation.
        Cr: likewise the angular momentum, shape (n, 3): coupling with rotation.
        Me: mass matrix of the modes, shape (n, n).
        Ke: stiffness, shape (n, n).
        De: damping, shape (n, n).
        turns: how far the modes turn the nodes in rad, shape (k, 3, n); None where a file does not say.
        Oe: what turning the frame does to the modes, by the products xx, yy, zz, xy, yz, xz of its rates,
            shape (n, 6); None likewise.
    """

    mass: float
    places: np.ndarray
    shapes: np.ndarray
    first_moment: np.ndarray
    inertia: np.ndarray
    Ct: np.ndarray
    Cr: np.ndarray
    Me: np.ndarray
    Ke: np.ndarray
    De: np.ndarray
    turns: np.ndarray | None = None
    Oe: np.ndarray | None = None

    def frequencies(self) -> np.ndarray:
        """Natural frequencies with the frame held, in rad/s; shape (n,)."""
        return np.sqrt(np.maximum(eigh(self.Ke, self.Me, eigvals_only=True), 0.0))

    def turned(self, load: float = 0.0, node: int = -1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mass, damping and stiffness of (angle, modes) where a joint turns the frame about z.

        Args:
            load: point mass in kg.
            node: at which the load is, counted from 0.

        Returns:
            Shape (1 + n, 1 + n) each.
        """
        rows = np.column_stack([np.cross([0.0, 0.0, 1.0], self.places[node]), self.shapes[node]])
        mass = np.block([[self.inertia[2, 2], self.Cr[:, 2]], [self.Cr[:, 2:], self.Me]])
        damping, stiffness = np.zeros_like(mass), np.zeros_like(mass)
        damping[1:, 1:], stiffness[1:, 1:] = self.De, self.Ke
        return mass + load * rows.T @ rows, damping, stiffness

    def output(self, node: int) -> np.ndarray:
        """How far (angle, modes) move a node across the line from the joint to it, in m; shape (1 + n,)."""
        lever = self._lever(node)
        across = np.cross([0.0, 0.0, 1.0], self.places[node]) / lever
        return np.append(lever, across @ self.shapes[node])

    def input_column(self) -> np.ndarray:
        """What the torque of a joint about z acts on: the frame, and modes that turn the node at the joint.

        Shape (1 + n, 1). Without a node on the axis, or without `turns`, the joint turns the frame alone.

        Raises:
            ValueError: if modes move the node at the joint, which the joint would hold.
        """
        B = np.eye(1 + len(self.Me), 1)
        away = np.hypot(self.places[:, 0], self.places[:, 1])
        at_joint = int(np.argmin(away))
        if away[at_joint] > _ROUNDING * away.max():
            return B
        if np.abs(self.shapes[at_joint, :2]).max() > _ROUNDING * np.abs(self.shapes).max():
            raise ValueError(f"flexible body: modes move node {at_joint + 1}, which the joint holds")
        if self.turns is not None:
            B[1:, 0] = self.turns[at_joint, 2]
        return B

    def zeros(self, node: int = -1, load: float = 0.0) -> Zeros:
        """From the torque of a joint about z to `output`; the load is at the last node."""
        M, D, K = self.turned(load)
        return transmission_zeros(M, D, K, self.input_column(), self.output(node)[None])

    def _lever(self, node: int) -> float:
        lever = float(np.hypot(*self.places[node, :2]))
        if not lever > 0.0:
            raise ValueError("flexible body: the node is on the axis of the joint")
        return lever


def beam_body(
    length: float, mass: float, bending_stiffness: float, elements: int, modes: int, damping: float = 0.0
) -> FlexibleBody:
    """A beam along x, clamped to its frame and bending in the xy-plane, from a mesh of Hermite elements.

    Args:
        length: in m.
        mass: in kg.
        bending_stiffness: E I in N m^2.
        elements: of the mesh, of equal length.
        modes: how many are kept, at most twice as many as elements.
        damping: of each mode, relative to the critical one.

    Raises:
        ValueError: if there are more modes than the mesh has.
    """
    if not 1 <= modes <= 2 * elements:
        raise ValueError(
            f"beam of {elements} elements: modes must be between 1 and {2 * elements}, got {modes}"
        )
    h = length / elements
    M, K = np.zeros((2, 2 * (elements + 1), 2 * (elements + 1)))
    one = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]])
    flip = np.diag([1.0, -1.0])
    both = np.vstack([one, flip @ np.roll(one, 2, axis=1) @ np.kron(np.eye(2), flip)])
    bent = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]])
    bends = np.vstack([bent, flip @ np.roll(bent, 2, axis=1) @ np.kron(np.eye(2), flip)])
    for first in range(0, 2 * elements, 2):
        own = slice(first, first + 4)
        M[own, own] += mass / elements / 420.0 * both
        K[own, own] += bending_stiffness / h**3 * bends
    squares, shapes = eigh(K[2:, 2:], M[2:, 2:], subset_by_index=(0, modes - 1))
    full = np.vstack([np.zeros((2, modes)), shapes])
    x = np.linspace(0.0, length, elements + 1)
    push, turn = np.zeros((2, len(full)))
    push[::2], turn[::2], turn[1::2] = 1.0, x, 1.0
    Ct, Cr = np.zeros((2, modes, 3))
    Ct[:, 1], Cr[:, 2] = push @ M @ full, turn @ M @ full
    Oe = np.zeros((modes, 6))
    Oe[:, 3] = Cr[:, 2]  # of x phi over the mass, as C_r
    moved, turned = np.zeros((2, elements + 1, 3, modes))
    moved[:, 1], turned[:, 2] = full[::2], full[1::2]
    about = mass * length**2 / 3.0
    return FlexibleBody(
        mass,
        np.column_stack([x, 0.0 * x, 0.0 * x]),
        moved,
        np.array([0.5 * mass * length, 0.0, 0.0]),
        np.diag([0.0, about, about]),
        Ct,
        Cr,
        np.eye(modes),
        np.diag(squares),
        np.diag(2.0 * damping * np.sqrt(squares)),
        turned,
        Oe,
    )
